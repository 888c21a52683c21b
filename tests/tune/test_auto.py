"""A search for the constants: gone on with where it stopped, judged beside what was before, refused where wrong."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from caldrive.commands.tune import Tune
from caldrive.control.presets import DEFAULT, PAPER, controller_config
from caldrive.progress import silent
from caldrive.tune import auto
from caldrive.tune.auto import missing_trials, run_trial, tune
from caldrive.tune.config import CostWeights, TuneConfig
from caldrive.tune.constants import with_values
from caldrive.tune.maneuvers import Maneuver
from tests.command_line import refusal

RIGHT = TuneConfig(trials=3, maneuvers=("right",), routes=0, constants=("longitudinal.turn_speed",))


@pytest.fixture
def quick(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """Drives that cost what the turn speed is off 20 km/h; which speeds were driven."""
    driven: list[float] = []

    class Costly:
        def __init__(self, speed: float) -> None:
            self.speed = speed

        def total(self, _: CostWeights) -> float:
            return abs(self.speed - 20.0)

    def drive(_: Maneuver, config: Any) -> float:
        driven.append(config.longitudinal.turn_speed)
        return driven[-1]

    monkeypatch.setattr(auto, "drive", drive)
    monkeypatch.setattr(auto, "cost", Costly)
    monkeypatch.setattr(auto, "mean_cost", lambda costs: costs[0])
    return driven


def test_the_first_trial_is_the_controller_as_it_is(quick: list[float], tmp_path: Path) -> None:
    tune(replace(RIGHT, trials=1), DEFAULT, tmp_path)
    assert quick[0] == DEFAULT.longitudinal.turn_speed
    tune(replace(RIGHT, trials=1), PAPER, tmp_path / "paper")  # which has no such limit
    assert set(quick[1:]) == {15.0, math.inf}
    assert quick[3] == math.inf


def test_a_kill_in_the_first_trial_does_not_lose_the_controller_as_it_is(quick: list[float], tmp_path: Path) -> None:
    study = auto.open_study(tmp_path, RIGHT)
    study.ask().set_user_attr(auto.NUMBER, 0)
    tune(RIGHT, DEFAULT, tmp_path)
    assert quick[0] == DEFAULT.longitudinal.turn_speed


def test_a_trial_that_was_done_twice_counts_once(quick: list[float], tmp_path: Path) -> None:
    for _ in range(2):
        run_trial(tmp_path, RIGHT, DEFAULT, 0)
    assert missing_trials(tmp_path, RIGHT) == [1, 2]
    assert tune(RIGHT, DEFAULT, tmp_path).trials == 3


def test_a_trial_is_pruned_by_its_mean_so_far_and_not_by_its_best(tmp_path: Path) -> None:
    study = auto.open_study(tmp_path, RIGHT)
    for _ in range(auto.STARTUP_TRIALS):
        assert not auto.is_worse(study, 1, 9.0)
        trial = study.ask()
        trial.set_user_attr(auto.NUMBER, trial.number)
        for step, mean in enumerate((0.9, 0.8)):
            trial.report(mean, step)
        study.tell(trial, 0.8)
    assert not auto.is_worse(study, 0, 0.9)
    assert auto.is_worse(study, 1, 0.85)  # whatever it was before


def test_a_killed_process_does_not_lock_the_trials_in_a_folder_named_from_here(
    quick: list[float], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    tune(RIGHT, DEFAULT, Path("out"))
    lock = tmp_path / "out" / "journal.log.lock"
    study = auto.open_study(Path("out"), RIGHT)
    backend = study._storage._backend._lock
    assert backend.acquire()
    assert lock.resolve() == tmp_path / "out" / "journal.log"  # not a link to nowhere
    backend.release()


def test_a_search_finds_what_costs_less(quick: list[float], tmp_path: Path) -> None:
    found = tune(replace(RIGHT, trials=30), DEFAULT, tmp_path)
    assert abs(found.after.controller.longitudinal.turn_speed - 20.0) < 2.0
    assert found.before.controller == DEFAULT
    assert found.after.controller == with_values(
        DEFAULT, {"longitudinal.turn_speed": found.after.controller.longitudinal.turn_speed}
    )


def test_what_is_no_better_is_not_taken(quick: list[float], tmp_path: Path) -> None:
    best = with_values(DEFAULT, {"longitudinal.turn_speed": 20.0})
    assert tune(replace(RIGHT, trials=8), best, tmp_path).after.controller == best


def test_a_search_that_was_stopped_goes_on(quick: list[float], tmp_path: Path) -> None:
    whole, parts = tmp_path / "whole", tmp_path / "parts"
    tune(replace(RIGHT, trials=6), DEFAULT, whole)
    expected = quick[:6]
    quick.clear()
    parts.mkdir()
    missing_trials(parts, RIGHT)
    run_trial(parts, RIGHT, DEFAULT, 0)
    tune(replace(RIGHT, trials=6), DEFAULT, parts)
    assert quick[:6] == expected


def test_fewer_trials_than_there_are_are_the_first(quick: list[float], tmp_path: Path) -> None:
    few = tune(RIGHT, DEFAULT, tmp_path / "few")
    many = tune(replace(RIGHT, trials=12), DEFAULT, tmp_path)
    quick.clear()
    again = tune(RIGHT, DEFAULT, tmp_path)
    assert len(quick) == 2  # before and after are judged, and nothing else is driven
    assert (few.trials, many.trials, again.trials) == (3, 12, 3)
    assert again.after.controller == few.after.controller != many.after.controller


def test_the_file_that_a_search_begins_with_is_not_written_over(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    own = tmp_path / "controller.toml"
    own.write_text("cap = 30.0\n")
    said = refusal(capsys, "tune", "--auto", "--controller", str(own), "--out", str(tmp_path / "." / ""))
    assert "which the search would write over, wanted another file: give another --out" in said
    assert own.read_text() == "cap = 30.0\n"
    assert list(tmp_path.iterdir()) == [own]


def test_a_folder_of_another_search_is_refused(quick: list[float], tmp_path: Path) -> None:
    tune(replace(RIGHT, trials=1), DEFAULT, tmp_path)
    with pytest.raises(ValueError, match=r"found in .* a search with seed 0, wanted 1: type the same"):
        tune(replace(RIGHT, trials=1, seed=1), DEFAULT, tmp_path)
    with pytest.raises(ValueError, match=r"found in .* a search with controller"):
        tune(replace(RIGHT, trials=1), with_values(DEFAULT, {"cap": 20.0}), tmp_path)


def test_the_command_writes_a_controller_and_the_costs_before_and_after(tmp_path: Path) -> None:
    answer = Tune(auto=True, out=tmp_path, workers=1, tune=RIGHT).run(silent)
    assert answer.values["trials"] == 3
    assert answer.values["after"]["tuned"]["total"] <= answer.values["before"]["tuned"]["total"]
    page = (tmp_path / "report.md").read_text()
    assert re.findall(r"^\| where it was tuned \| (\w+) \|", page, re.MULTILINE) == ["before", "after"]
    found = controller_config(str(tmp_path / "controller.toml"), None).longitudinal.turn_speed
    changed = answer.values["changed"].get("longitudinal.turn_speed", [15.0, 15.0])
    assert (changed[0], changed[1]) == (15.0, found)


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (("--trials", "0"), "found --trials 0"),
        (("--routes", "13"), "found --routes 13"),
        (("--constants", "wings"), "found --constants wings, wanted some of longitudinal.cruise.kp"),
        (("--constants", "longitudinal.red_gain", "longitudinal.red_gain"), "found --constants longitudinal.red_gain"),
        (("--cost.jerk", "-1"), "found --cost.jerk -1"),
        (("--maneuvers", "fly"), "wanted one of"),
        (("--controller", "gone.toml"), "found no file gone.toml"),
        (("--controller", "mine.py:Own"), "mine.py:Own"),
        (("--workers", "0", "--auto"), "found --workers 0"),
        (("--port", "80"), "found --port 80, wanted 1024 to 65535"),
    ],
)
def test_what_cannot_be_is_refused(
    words: tuple[str, ...], expected: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    monkeypatch.chdir(tmp_path)
    assert expected in refusal(capsys, "tune", *words)
    assert list(tmp_path.iterdir()) == []
