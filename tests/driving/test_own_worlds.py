"""A world of one's own, the straight road of the tests, driven by the command line's code."""

from __future__ import annotations

import json
from pathlib import Path

import av
import numpy as np
import pytest

import tests.fakes
from caldrive.driving.settings import DriverSettings
from caldrive.driving.setup import make_world, set_up
from caldrive.interfaces import is_mapped
from caldrive.visualization.hud import CAMERA, SIZE
from tests.command_line import refusal, run_json, write_agent

WORLD = f"{tests.fakes.__file__}:StraightRoad"
DRIVE = ["drive", "--agent", "oracle", "--world", WORLD, "--from", "0,0", "--to", "60,0"]


def test_a_world_is_closed_where_its_agent_cannot_be_made(monkeypatch: pytest.MonkeyPatch) -> None:
    closed = []
    monkeypatch.setattr(tests.fakes.StraightRoad, "close", lambda world: closed.append(world))
    with pytest.raises(ValueError, match="found controller 'wild'"):
        set_up(DriverSettings(agent="oracle", controller="wild", world="tests.fakes:StraightRoad"))
    assert len(closed) == 1


def test_it_has_neither_map_nor_movable_cameras() -> None:
    assert not is_mapped(make_world(WORLD))


def test_the_oracle_reaches_a_place_and_is_filmed_on_the_way(tmp_path: Path) -> None:
    report = run_json(*DRIVE, "--out", str(tmp_path))
    (episode,) = report["episodes"]
    assert episode["outcome"] == "success"
    assert episode["distance"] == pytest.approx(58, abs=1)
    assert episode["scenario"]["task"] == "own"
    steps = len(json.loads((tmp_path / "episode-000.json").read_text())["trace"]["time"])
    with av.open(report["video"]) as film:
        frames = [frame.to_ndarray(format="rgb24") for frame in film.decode(video=0)]
    assert [frame.shape for frame in frames] == [(SIZE[1], SIZE[0], 3)] * (steps + 15)
    picture = frames[steps // 2][50 : CAMERA.height]  # what the agent's camera shows
    assert np.median(picture, axis=(0, 1)) == pytest.approx(tests.fakes.IMAGE[0, 0], abs=6)


def test_an_agent_of_ones_own_drives_in_it_twice_the_same(tmp_path: Path) -> None:
    agent = write_agent(tmp_path, "def act(self, observation):\n    return Control(throttle=0.5)")
    report = run_json(
        *("drive", "--agent", agent, "--world", WORLD, "--from", "0,0", "--to", "30,0", "--out", str(tmp_path))
    )
    assert report["episodes"][0]["outcome"] == "success"
    arguments = ("--agent", agent, "--world", WORLD, "--from", "0,0", "--to", "30,0")
    assert run_json("determinism", *arguments)["equal"]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--world", WORLD], "type --from X,Y --to X,Y"),
        (
            ["--world", "mars", "--from", "0,0", "--to", "9,0"],
            "found world 'mars', wanted one of embedded, carla, or your own class",
        ),
        (["--world", "{tmp}/own.py:Half", "--from", "0,0", "--to", "9,0"], "Half has no step, wanted a world with dt"),
        (["--world", WORLD, "--from", "0,zero", "--to", "9,0"], "found --from 0,zero, wanted X,Y or X,Y,HEADING"),
    ],
)
def test_what_is_no_world_or_no_place_is_named(
    arguments: list[str], message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "own.py").write_text("class Half:\n    dt = 0.1\n    def reset(self, scenario): pass\n")
    command = ["drive", "--agent", "oracle", "--out", str(tmp_path / "out"), *arguments]
    assert message in refusal(capsys, *(word.replace("{tmp}", str(tmp_path)) for word in command))
