"""An episode that another suite drove is taken over as if it had been driven again, or it is driven again."""

from __future__ import annotations

import gzip
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from caldrive.benchmark import runner as runner
from caldrive.benchmark.reuse import reusable_records
from caldrive.benchmark.run_folder import RunFolder
from caldrive.benchmark.runner import benchmark
from caldrive.benchmark.settings import BenchmarkSettings
from caldrive.benchmark.suites import Trial, suite, to_json
from caldrive.results import EpisodeResult, Infraction, InfractionKind, Outcome, result_values
from tests.benchmark.traces import trace

pytestmark = pytest.mark.usefixtures("fresh_worker")
RED, CAR = InfractionKind.RED_LIGHT, InfractionKind.COLLISION_CAR
BY = {"agent": "oracle", "cap": 20.0, "controller": "default", "code": "1", "model": None, "precision": None}
CONDITIONS = {"suite": "x", "suite_content": None, "time_limit": "paper", "seed": 0, "model_file": None}
RUN = BY | CONDITIONS | {"began": "2026-01-01T00:00:00", "machine": "a clock", "workers": 2}


def short_suite(path: Path, task: str, fatal: tuple[InfractionKind, ...] = ()) -> str:
    """Two trials of three seconds under a name."""
    trials = [
        Trial(f"{task}-{k}", "training", replace(trial.scenario, time_limit=3.0, task=task), fatal)
        for k, trial in enumerate(suite("quick")[6:8])
    ]
    path.write_text(to_json(trials))
    return str(path)


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.rglob("*") if path.is_file() and path.name != "run.json"}


def test_what_is_taken_over_is_what_driving_gives(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    first = BenchmarkSettings(
        suite=short_suite(tmp_path / "a.json", "first"), agent="oracle", out=tmp_path / "first", workers=1
    )
    list(benchmark(first))
    other = replace(first, suite=short_suite(tmp_path / "b.json", "other", (RED,)), out=tmp_path / "other")
    list(benchmark(other))
    taken = replace(other, out=tmp_path / "taken", known=(tmp_path / "first",))
    monkeypatch.setattr(runner, "drive_trial", lambda driver, trial: pytest.fail("drives"))
    assert list(benchmark(taken)) == []
    assert len(RunFolder(taken.out).results()) == 2
    assert contents(taken.out) == contents(other.out)


def known_folder(folder: Path, trial: Trial, outcome: Outcome, kinds: tuple[InfractionKind, ...]) -> Path:
    """A folder in which an episode ended so."""
    infractions = tuple(Infraction(kind, time=1.0 + k, x=0.0, y=0.0) for k, kind in enumerate(kinds))
    episode = EpisodeResult(
        scenario=replace(trial.scenario, task="x"), outcome=outcome, duration=30.0, distance=900.0,
        route_done=1.0, route_length=9.0, infractions=infractions,
    )  # fmt: skip
    result = result_values(episode)
    line: dict[str, Any] = {"key": "x-0", "result": result, "figures": {}}
    (folder / "run.json").write_text(json.dumps(RUN))
    (folder / "results.jsonl").write_text(json.dumps(line) + "\n")
    (folder / "traces").mkdir()
    (folder / "traces" / "x-0.json.gz").write_bytes(
        gzip.compress(json.dumps({"result": result, "trace": trace()}).encode())
    )
    return folder


@pytest.mark.parametrize(
    ("outcome", "kinds", "fatal", "taken"),
    [
        (Outcome.SUCCESS, (), (RED, CAR), True),
        (Outcome.SUCCESS, (RED,), (CAR,), True),
        (Outcome.TIMEOUT, (RED, RED), (CAR,), True),
        (Outcome.SUCCESS, (RED,), (RED, CAR), False),  # would have ended there
        (Outcome.FAILED, (CAR,), (RED, CAR), True),
        (Outcome.FAILED, (RED, CAR), (RED, CAR), False),  # would have ended before
        (Outcome.FAILED, (RED,), (CAR,), False),  # would have gone on
    ],
)
def test_an_episode_that_would_end_elsewhere_is_driven_again(
    outcome: Outcome, kinds: Any, fatal: Any, taken: bool, tmp_path: Path
) -> None:
    trial = replace(suite("quick")[0], fatal=fatal)
    folder = known_folder(tmp_path, trial, outcome, kinds)
    records = list(reusable_records([RunFolder(folder)], [trial], BY))
    assert [record.line["key"] for record in records] == ([trial.key] if taken else [])


def test_an_episode_that_was_counted_by_other_rules_is_driven_again(tmp_path: Path) -> None:
    trial = suite("quick")[0]
    folder = known_folder(tmp_path, trial, Outcome.SUCCESS, ())
    assert list(reusable_records([RunFolder(folder)], [replace(trial, rules="nocrash")], BY)) == []


def test_an_episode_without_its_trace_is_driven(tmp_path: Path) -> None:
    trial = suite("quick")[0]
    folder = known_folder(tmp_path, trial, Outcome.SUCCESS, ())
    assert len(list(reusable_records([RunFolder(folder)], [trial], BY))) == 1
    (folder / "traces" / "x-0.json.gz").unlink()
    assert list(reusable_records([RunFolder(folder)], [trial], BY)) == []


def test_an_episode_of_other_traffic_is_driven(tmp_path: Path) -> None:
    trial = suite("quick")[0]
    folder = known_folder(tmp_path, trial, Outcome.SUCCESS, ())
    busier = replace(trial, scenario=replace(trial.scenario, n_vehicles=7))
    assert list(reusable_records([RunFolder(folder)], [busier], BY)) == []


@pytest.mark.parametrize(("name", "value"), [("code", "2"), ("agent", "cal"), ("cap", None), ("model", "3")])
def test_episodes_driven_by_something_else_are_refused(name: str, value: object, tmp_path: Path) -> None:
    trial = suite("quick")[0]
    folder = known_folder(tmp_path, trial, Outcome.SUCCESS, ())
    with pytest.raises(ValueError, match=f"episodes with {name} .*leave that --known out"):
        list(reusable_records([RunFolder(folder)], [trial], BY | {name: value}))
