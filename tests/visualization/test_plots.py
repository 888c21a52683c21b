"""An episode's speed over distance as a picture."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from caldrive.visualization.plots import draw_speed


def test_a_drive_with_every_state_and_one_of_a_single_step_are_drawn(tmp_path: Path) -> None:
    columns: dict[str, list[Any]] = {
        "route_done": [5.0 * k for k in range(7)],
        "state": ["cruising", "hazard stop", "red light", "over limit", "following", "blind", None],
        "speed": [2.0 * k for k in range(7)],
        "road_limit": [30.0] * 7,
        "speed_limit": [None, *[60.0] * 6],
    }
    draw_speed(columns, "town01", tmp_path / "new" / "speed.png")
    draw_speed({name: values[:1] for name, values in columns.items()}, "stands", tmp_path / "stands.png")
    with Image.open(tmp_path / "new" / "speed.png") as whole, Image.open(tmp_path / "stands.png") as short:
        assert whole.size == short.size == (1080, 324)
        colors = {color for _, color in whole.convert("RGB").getcolors(1 << 20) or ()}
    assert {(217, 83, 79), (240, 195, 109)} <= colors


def count(path: Path, color: tuple[int, int, int]) -> int:
    """Pixels of about a colour; those at the edges of a line are paler."""
    picture = np.asarray(Image.open(path).convert("RGB")).astype(int)
    return int((np.abs(picture - color).max(-1) < 30).sum())


def test_what_an_agent_does_not_tell_is_left_out(tmp_path: Path) -> None:
    columns: dict[str, list[Any]] = {
        "route_done": [5.0 * k for k in range(7)],
        "state": [None] * 7,
        "speed": [2.0 * k for k in range(7)],
        "road_limit": [30.0] * 7,
        "speed_limit": [None] * 7,
    }
    draw_speed(columns, "an agent of ten lines", tmp_path / "bare.png")
    draw_speed(columns | {"speed_limit": [20.0] * 4 + [None] * 3}, "with limits", tmp_path / "limits.png")
    speed, limit = (31, 78, 121), (200, 120, 45)
    assert count(tmp_path / "bare.png", speed) > 100
    assert count(tmp_path / "bare.png", limit) == 0  # not in the legend either
    assert count(tmp_path / "limits.png", limit) > 50


def test_states_of_an_agents_own_are_not_shaded(tmp_path: Path) -> None:
    columns: dict[str, list[Any]] = {
        "route_done": [0.0, 5.0], "state": ["looking around"] * 2, "speed": [1.0, 2.0],
        "road_limit": [None, None], "speed_limit": [30.0, 30.0],
    }  # fmt: skip
    draw_speed(columns, "states", tmp_path / "own.png")
    draw_speed(columns | {"state": [None] * 2}, "states", tmp_path / "none.png")
    assert (tmp_path / "own.png").read_bytes() == (tmp_path / "none.png").read_bytes()
