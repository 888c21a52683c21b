"""An episode's speed over distance as a picture."""

from __future__ import annotations

from pathlib import Path
from typing import Any

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
