"""A controller of one's own, as a file of constants or a class, drives wherever a controller is taken."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from caldrive.benchmark.suites import suite, to_json
from tests.command_line import refusal, run_json

pytestmark = pytest.mark.usefixtures("no_sumo_left")

DRIVE = ["drive", "--agent", "oracle", "--no-video", "--town", "town02", "--task", "straight", "--seconds", "3"]
CLASS = """
from caldrive import Control, Decision

class Careful:
    def __init__(self, cap, dt):
        self.speed = cap / 3.6 / 2

    def step(self, affordances, speed, command):
        control = Control(throttle=0.4 if speed < self.speed else 0.0, steer=0.5 * affordances.relative_angle)
        return Decision(control, affordances, "careful", speed_limit=None, target_speed=3.6 * self.speed)
"""


def drive(controller: str, out: Path, *more: str) -> dict[str, list[Any]]:
    """The trace of three seconds."""
    run_json(*DRIVE, "--controller", controller, "--out", str(out), *more)
    trace: dict[str, list[Any]] = json.loads((out / "episode-000.json").read_text())["trace"]
    return trace


def test_a_preset_and_a_file_of_its_constants_drive_the_same(tmp_path: Path) -> None:
    (tmp_path / "laws.toml").write_text('preset = "paper"\n')
    by_name, by_file = drive("paper", tmp_path), drive(str(tmp_path / "laws.toml"), tmp_path)
    assert by_name == by_file != drive("default", tmp_path)


def test_one_constant_in_a_file_changes_one_thing(tmp_path: Path) -> None:
    (tmp_path / "laws.toml").write_text("initial_limit = 20.0\n")
    changed, usual = drive(str(tmp_path / "laws.toml"), tmp_path), drive("default", tmp_path)
    assert set(changed["speed_limit"]) == {20.0}
    assert set(usual["speed_limit"]) == {30.0}


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("initial_speed = 3.0", "found initial_speed in {file}, wanted one of longitudinal,"),
        ("[longitudinal]\nred_flor = 0.5", "found red_flor in {file}, longitudinal, wanted one of"),
        ('blind_brake = "much"', "found 'much' in {file}, blind_brake"),
        ("blind_brake =", "{file} is no TOML"),
    ],
)
def test_a_constant_that_there_is_not_is_named(
    text: str, message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "laws.toml"
    file.write_text(text)
    printed = refusal(capsys, *DRIVE, "--controller", str(file), "--out", str(tmp_path / "out"))
    assert message.format(file=file) in printed


def test_a_class_of_ten_lines_drives(tmp_path: Path) -> None:
    (tmp_path / "careful.py").write_text(CLASS)
    trace = drive(f"{tmp_path / 'careful.py'}:Careful", tmp_path, "--cap", "18")
    assert set(trace["state"]) == {"careful"}
    assert trace["target_speed"] == [9.0] * 31
    assert max(trace["throttle"]) == 0.4
    assert trace["predicted_center_distance"] == trace["true_center_distance"]
    assert trace["speed_limit"] == [None] * 31


@pytest.mark.parametrize(
    ("body", "message"),
    [
        ("pass", "Own has no method step, wanted step(affordances, speed, command)"),
        ("def step(self, affordances, speed, command): return 3", "the controller Own returned 3, wanted a Decision"),
        ("def step(self, affordances, speed, command): return 1 / 0", "at step 0 (0.0 s) (ZeroDivisionError"),
        ("def step(self): pass", "at step 0 (0.0 s) (TypeError"),
        ("def __init__(self): raise ValueError('no key')", "Own cannot be made (ValueError: no key, own.py line 2)"),
    ],
)
def test_a_class_that_is_no_controller_ends_in_a_sentence(
    body: str, message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "own.py").write_text(f"class Own:\n    {body}\n")
    controller = f"{tmp_path / 'own.py'}:Own"
    assert message in refusal(capsys, *DRIVE, "--controller", controller, "--out", str(tmp_path / "out"))


@pytest.mark.parametrize("name", ["laws.toml", "careful.py:Careful"])
def test_a_benchmark_does_not_go_on_with_a_changed_controller(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "laws.toml").write_text("initial_limit = 20.0\n")
    (tmp_path / "careful.py").write_text(CLASS)
    first = suite("quick")[0]
    (tmp_path / "short.json").write_text(to_json([replace(first, scenario=replace(first.scenario, time_limit=1.0))]))
    arguments = (
        *("benchmark", "--agent", "oracle", "--controller", str(tmp_path / name), "--workers", "1"),
        *("--suite", str(tmp_path / "short.json"), "--out", str(tmp_path / "run")),
    )
    run_json(*arguments)
    run_json(*arguments)
    changed = tmp_path / name.partition(":")[0]
    changed.write_text(changed.read_text() + "# changed\n")
    assert "results with controller_source" in refusal(capsys, *arguments)
