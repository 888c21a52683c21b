"""`caldrive town`: a sheet of camera images, a plan with coordinates, a map for other programs."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image as Picture

from caldrive.cli import main
from caldrive.world.roads.network import RoadNetwork
from caldrive.world.roads.opendrive_writer import write_opendrive
from tests.command_line import run_json


def size(path: str) -> tuple[int, int]:
    """Width and height of a picture's file, which is closed again."""
    with Picture.open(path) as picture:
        return picture.size


@pytest.fixture
def _plain_sheet(monkeypatch: pytest.MonkeyPatch) -> None:
    """A contact sheet that needs no camera."""

    def sheet(town: str, randomised: int) -> np.ndarray[Any, Any]:
        return np.full((40, 80, 3), len(town) + randomised, np.uint8)

    monkeypatch.setattr("caldrive.visualization.contact_sheet.contact_sheet", sheet)


@pytest.mark.usefixtures("_plain_sheet")
def test_town_writes_its_sheet(tmp_path: Path) -> None:
    answer = run_json("town", "--town", "town02", "--sheet", str(tmp_path / "a" / "town.png"), "--width", "160")
    assert (answer["width"], answer["height"]) == (160, 80)
    assert size(answer["sheet"]) == (160, 80)
    assert [path.name for path in (tmp_path / "a").iterdir()] == ["town.png"]


@pytest.mark.usefixtures("_plain_sheet")
def test_town_without_options_writes_the_sheet(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert run_json("town")["sheet"] == "out/town.png"
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["town.png"]


def test_town_writes_the_plan_alone_where_only_that_is_asked_for(tmp_path: Path) -> None:
    answer = run_json("town", "--town", "town02", "--plan", str(tmp_path / "plan.png"), "--width", "1100")
    assert (answer["plan_width"], answer["plan_height"]) == size(answer["plan"])
    assert answer["plan_width"] == 1100
    assert (answer["left_out"], answer["offset"]) == ([], [0.0, 0.0])
    assert "sheet" not in answer
    assert [path.name for path in tmp_path.iterdir()] == ["plan.png"]


@pytest.mark.usefixtures("_plain_sheet")
def test_town_writes_both(tmp_path: Path) -> None:
    answer = run_json("town", "--plan", str(tmp_path / "plan.png"), "--sheet", str(tmp_path / "sheet.png"))
    assert (answer["plan"], answer["sheet"]) == (str(tmp_path / "plan.png"), str(tmp_path / "sheet.png"))
    assert sorted(path.name for path in tmp_path.iterdir()) == ["plan.png", "sheet.png"]


def test_town_writes_the_map_alone_where_only_that_is_asked_for(tmp_path: Path, town02: RoadNetwork) -> None:
    answer = run_json("town", "--town", "town02", "--opendrive", str(tmp_path / "a" / "town02.xodr"))
    assert answer["opendrive"] == str(tmp_path / "a" / "town02.xodr")
    assert (tmp_path / "a" / "town02.xodr").read_bytes() == write_opendrive(town02)
    assert [path.name for path in tmp_path.rglob("*.*")] == ["town02.xodr"]


MISTAKES = {
    "a map of another kind": (["--opendrive", "town01.xml"], "type --opendrive town01.xodr"),
    "a map of a map": (["--opendrive", "b.xodr", "--town", "a.xodr"], "type --town town01"),
    "a plan of another kind": (["--plan", "plan.pdf"], "ends in .png"),
    "a sheet of another kind beside a plan": (["--plan", "plan.png", "--sheet", "sheet.jpg"], "ends in .png"),
    "a plan too small to read": (["--plan", "plan.png", "--width", "100"], "type --width 1600"),
    "one file for both": (["--plan", "a.png", "--sheet", "a.png"], "type another --plan"),
    "looks of a plan": (["--plan", "plan.png", "--randomised", "2"], "type --sheet FILE"),
    "too many looks, beside a plan": (
        ["--plan", "plan.png", "--sheet", "sheet.png", "--randomised", "101"],
        "type --randomised 8",
    ),
    "an unknown town": (["--plan", "plan.png", "--town", "mars"], "type --town town01"),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_mistake_ends_in_one_sentence_and_leaves_nothing(
    mistake: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    arguments, expected = MISTAKES[mistake]
    assert main(["town", *arguments]) == 2
    printed = capsys.readouterr().err
    assert printed.startswith("caldrive: found ")
    assert printed.count("\n") == 1
    assert expected in printed
    assert list(tmp_path.iterdir()) == []
