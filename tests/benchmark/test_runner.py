"""The runner: broken off anywhere it ends with the results of an unbroken run, and it mixes no two runs."""

from __future__ import annotations

import gzip
import json
import re
import shutil
from collections.abc import Callable
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import simplejpeg

from caldrive.benchmark import run_folder
from caldrive.benchmark.artifacts import read_still, read_trace, still_paths, trace_path
from caldrive.benchmark.replay import replay
from caldrive.benchmark.result_lines import read_lines
from caldrive.benchmark.run_folder import EpisodeRecord, RunFolder, suite_digest, trial_result
from caldrive.benchmark.runner import benchmark
from caldrive.benchmark.settings import BenchmarkSettings
from caldrive.benchmark.suites import from_json, suite, to_json
from caldrive.datatypes import Pose
from caldrive.files import locked_folder
from caldrive.provenance import code_version
from tests.benchmark.traces import trace

pytestmark = pytest.mark.usefixtures("fresh_worker")


@pytest.fixture(scope="module")
def settings(tmp_path_factory: pytest.TempPathFactory) -> BenchmarkSettings:
    """Four trials of three seconds, one of them among others."""
    folder = tmp_path_factory.mktemp("suite")
    trials = [replace(trial, scenario=replace(trial.scenario, time_limit=3.0)) for trial in suite("quick")[4:8]]
    (folder / "short.json").write_text(to_json(trials))
    return BenchmarkSettings(suite=str(folder / "short.json"), agent="oracle", out=folder / "whole", workers=1)


@pytest.fixture(scope="module")
def whole(settings: BenchmarkSettings) -> BenchmarkSettings:
    assert [step.done for step in benchmark(settings)] == [1, 2, 3, 4]
    return settings


def lines(settings: BenchmarkSettings) -> list[bytes]:
    return sorted((settings.out / "results.jsonl").read_bytes().splitlines())


def test_a_run_broken_off_goes_on_to_the_same_results(whole: BenchmarkSettings, tmp_path: Path) -> None:
    resumed = replace(whole, out=tmp_path)
    run = benchmark(resumed)
    next(run)
    run.close()  # type: ignore[attr-defined]
    with (tmp_path / "results.jsonl").open("ab") as file:  # as if killed while writing
        file.write(b'{"key": "tow')
    assert len(read_lines(tmp_path).by_trial) == 1
    assert [step.done for step in benchmark(resumed)] == [2, 3, 4]
    assert lines(resumed) == lines(whole)
    assert RunFolder(resumed.out).results() == RunFolder(whole.out).results()
    assert list(benchmark(resumed)) == []


def test_two_workers_find_what_one_finds(whole: BenchmarkSettings, tmp_path: Path) -> None:
    two = replace(whole, out=tmp_path, workers=2)
    list(benchmark(two))
    assert lines(two) == lines(whole)


@pytest.mark.skipif(find_spec("ray") is None, reason="Ray is not installed")
def test_rays_workers_find_what_one_finds(whole: BenchmarkSettings, tmp_path: Path) -> None:
    ray = replace(whole, out=tmp_path, workers=2, ray="local")
    list(benchmark(ray))
    assert lines(ray) == lines(whole)
    files = [sorted(path.name for path in (run.out / "traces").iterdir()) for run in (ray, whole)]
    assert files[0] == files[1]


def test_results_stand_in_the_suites_order(whole: BenchmarkSettings) -> None:
    results = RunFolder(whole.out).results()
    assert [result.trial for result in results] == suite(whole.suite)
    assert all(result.episode.duration == pytest.approx(3.0, abs=0.11) for result in results)
    assert all(result.metrics["error/center_distance"] == 0 for result in results)  # the oracle's


@pytest.mark.parametrize("change", [{"signs": True}, {"cap": 30.0}, {"controller": "paper"}])
def test_results_of_another_run_are_not_added_to(whole: BenchmarkSettings, change: dict[str, object]) -> None:
    with pytest.raises(ValueError, match="give another --out"):
        next(benchmark(replace(whole, **change)))  # type: ignore[arg-type]


def test_another_version_of_the_code_is_another_run(whole: BenchmarkSettings, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(run_folder, "code_version", lambda: "other")
    with pytest.raises(ValueError, match="with code"):
        next(benchmark(whole))


def test_an_episode_driven_again_goes_as_before(whole: BenchmarkSettings, tmp_path: Path) -> None:
    (trial, *_) = suite(whole.suite)
    again = replay(whole.out, trial.key, tmp_path / "again.mp4")
    assert again.same
    assert again.video.stat().st_size > 1000
    with pytest.raises(ValueError, match="found no episode 'x'"):
        replay(whole.out, "x", tmp_path / "other.mp4")


@pytest.mark.parametrize("name", ["results.jsonl", "results.jsonl.gz"])
def test_results_that_nothing_says_whose_they_are_are_refused(
    name: str, whole: BenchmarkSettings, tmp_path: Path
) -> None:
    content = (whole.out / name).read_bytes() if name == "results.jsonl" else gzip.compress(b"nonsense\n")
    (tmp_path / name).write_bytes(content)
    with pytest.raises(ValueError, match=r"no run\.json that says whose"):
        next(benchmark(replace(whole, out=tmp_path)))
    assert [path.name for path in tmp_path.iterdir()] == [name]


def test_a_folder_in_which_nothing_was_driven_is_free_for_another_run(whole: BenchmarkSettings, tmp_path: Path) -> None:
    (tmp_path / "agent.py").write_text("class Own:\n    def __init__(self):\n        raise KeyError(3)\n")
    out = tmp_path / "out"
    with pytest.raises(ValueError, match="Own cannot be made"):
        next(benchmark(replace(whole, agent=f"{tmp_path / 'agent.py'}:Own", out=out)))
    (out / "results.jsonl").write_bytes(b'{"key": "tow')  # killed while writing its first line
    (trial, *_) = suite(whole.suite)
    (out / "stills").mkdir()
    (out / "stills" / f"{trial.key}-3.jpg").touch()
    assert next(benchmark(replace(whole, out=out))).done == 1
    assert RunFolder(out).description["agent"] == "oracle"
    assert len(still_paths(out, trial.key)) == len(still_paths(whole.out, trial.key))


def test_lines_that_are_compressed_are_not_hidden_by_a_new_one(whole: BenchmarkSettings, folder: RunFolder) -> None:
    first_three = b"".join((whole.out / "results.jsonl").read_bytes().splitlines(keepends=True)[:3])
    (folder.path / "results.jsonl.gz").write_bytes(gzip.compress(first_three))
    again = replace(whole, out=folder.path)
    assert [state.done for state in benchmark(again)] == [4]
    assert lines(again) == lines(whole)


def test_two_at_once_are_refused(whole: BenchmarkSettings, tmp_path: Path) -> None:
    with locked_folder(tmp_path), pytest.raises(ValueError, match="another process at work"):
        next(benchmark(replace(whole, out=tmp_path)))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"weather": 99}, "found weather 99"),
        ({"town": "town09"}, "found town 'town09'"),
        ({"start": Pose(-900, 0, 0)}, "found no lane"),
        ({"n_vehicles": 900}, "found 900 cars asked for, but town"),
        ({"n_pedestrians": 90_000}, "found 90000 people asked for, but town"),
    ],
)
def test_a_trial_that_cannot_be_is_named_before_there_is_a_folder(
    change: dict[str, Any], message: str, whole: BenchmarkSettings, tmp_path: Path
) -> None:
    first, last = suite(whole.suite)[:2]
    trials = [first, replace(last, scenario=replace(last.scenario, **change))]
    (tmp_path / "own.json").write_text(to_json(trials))
    with pytest.raises(ValueError, match=f"{last.key} in .* cannot be driven .{message}"):
        next(benchmark(replace(whole, suite=str(tmp_path / "own.json"), out=tmp_path / "out")))
    assert not (tmp_path / "out").exists()


def test_results_of_another_episode_of_the_same_name_are_refused(whole: BenchmarkSettings) -> None:
    (trial, *_) = suite(whole.suite)
    line = RunFolder(whole.out).lines()[trial.key]
    other = replace(trial, scenario=replace(trial.scenario, seed=9))
    assert trial_result(trial, line).trial is trial
    with pytest.raises(ValueError, match="another episode when it was driven"):
        trial_result(other, line)


@pytest.mark.parametrize("change", [{"seed": 3}, {"time_limit": "code"}, {"seed": -1}])
def test_what_a_suite_does_not_take_claims_no_folder(
    change: dict[str, Any], whole: BenchmarkSettings, tmp_path: Path
) -> None:
    with pytest.raises(ValueError, match="found --seed"):
        next(benchmark(replace(whole, out=tmp_path, **change)))
    assert not list(tmp_path.iterdir())


DAMAGED = ["nonsense", "3", '{"key": "a"}', '{"key": "a", "result": 3, "figures": {}}', '{"key": NaN}']


@pytest.mark.parametrize("line", DAMAGED, ids=str)
def test_a_damaged_line_is_named_and_costs_its_own_episode_only(
    line: str, whole: BenchmarkSettings, tmp_path: Path
) -> None:
    (tmp_path / "run.json").write_bytes((whole.out / "run.json").read_bytes())
    sound = (whole.out / "results.jsonl").read_text().splitlines()
    (tmp_path / "results.jsonl").write_text("\n".join([sound[0], line, *sound[2:]]) + "\n")
    problems = RunFolder(tmp_path).problems()
    assert len(problems) == 2
    assert "line 2 of" in problems[0]
    assert "driven again" in problems[0]
    assert problems[1] == "unfinished: 3 of 4 episodes are driven"
    again = replace(whole, out=tmp_path)
    assert [state.done for state in benchmark(again)] == [4]
    assert lines(again) == lines(whole)
    assert RunFolder(tmp_path).problems() == []


def test_a_reader_is_told_of_foreign_lines_and_edited_results(whole: BenchmarkSettings, tmp_path: Path) -> None:
    shutil.copytree(whole.out, tmp_path / "run")
    assert RunFolder(tmp_path / "run").problems() == []
    path = tmp_path / "run" / "results.jsonl"
    rows = [json.loads(line) for line in path.read_text().splitlines()]
    rows[0]["result"]["distance"] += 100.0
    path.write_text("".join(json.dumps(row) + "\n" for row in [*rows, rows[1] | {"key": "of-another-suite"}]))
    foreign, edited = RunFolder(tmp_path / "run").problems()
    assert "lines of no trial" in foreign
    assert "of-another-suite" in foreign
    assert edited == f"lines that say something else than their traces: 1, such as {rows[0]['key']}"


@pytest.mark.parametrize(
    "change",
    [
        {"duration": "abc"}, {"route_length": 0.0}, {"distance": -1.0}, {"comfort": None}, {"outcome": "won"},
        {"infractions": [{"kind": "flight"}]}, {"scenario": {}}, {"distance": 1e9}, {"duration": 999.0},
        {"outcome": "success", "distance": 0.0}, {"comfort": {"jerk": None}},
        {"infractions": [{"kind": "red light", "time": 99.0, "x": 0.0, "y": 0.0}]},
    ],
    ids=str,
)  # fmt: skip
def test_results_that_cannot_be_are_named(change: dict[str, Any], whole: BenchmarkSettings, tmp_path: Path) -> None:
    line = json.loads((whole.out / "results.jsonl").read_bytes().splitlines()[0])
    (tmp_path / "results.jsonl").write_text(json.dumps(line | {"result": line["result"] | change}) + "\n")
    found = read_lines(tmp_path)
    assert found.by_trial == {}
    assert re.fullmatch(r"line 1 of .*results\.jsonl is damaged \(.+\)", found.damaged[0], re.DOTALL)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"figures": {"off_lane": None}}, "off_lane is no number"),
        ({"figures": {"off_lane": 1.5}}, "off_lane is 1.5"),
        ({"figures": {"reds_obeyed": -3}}, "reds_obeyed is -3"),
        ({"key": "../elsewhere"}, "'../elsewhere' is no key"),
        ({"key": "a\0"}, "it has a null byte"),
    ],
)
def test_figures_and_keys_that_cannot_be_are_named(
    change: dict[str, Any], message: str, whole: BenchmarkSettings, tmp_path: Path
) -> None:
    line = json.loads((whole.out / "results.jsonl").read_bytes().splitlines()[0])
    (tmp_path / "results.jsonl").write_text(json.dumps(line | change) + "\n")
    assert message in read_lines(tmp_path).damaged[0]


def test_an_episode_that_is_there_twice_counts_once_and_is_named(whole: BenchmarkSettings, tmp_path: Path) -> None:
    (tmp_path / "results.jsonl").write_bytes((whole.out / "results.jsonl").read_bytes() * 2)
    found = read_lines(tmp_path)
    assert (len(found.by_trial), len(found.damaged)) == (4, 4)
    assert "is there twice" in found.damaged[0]


def test_a_suite_that_has_changed_since_is_refused(whole: BenchmarkSettings, tmp_path: Path) -> None:
    path = tmp_path / "own.json"
    town = tmp_path / "town.xodr"
    town.write_text("first")
    trials = suite(whole.suite)
    elsewhere = replace(trials[0], key="x", scenario=replace(trials[0].scenario, town=str(town)))
    path.write_text(to_json([*trials, elsewhere]))
    about = RunFolder(whole.out).description | {
        "suite": str(path),
        "suite_content": suite_digest(path, from_json(path)),
    }
    (tmp_path / "run.json").write_text(json.dumps(about))
    assert len(RunFolder(tmp_path).trials) == len(trials) + 1
    shorter = to_json(trials[:1])
    for change in (lambda: town.write_text("second"), town.unlink, lambda: path.write_text(shorter), path.unlink):
        change()
        with pytest.raises(ValueError, match="is not what was driven"):
            _ = RunFolder(tmp_path).trials


@pytest.mark.parametrize("text", ["[1", "[]", "{}", '{"suite": 3}'])
def test_a_damaged_description_is_named(text: str, tmp_path: Path) -> None:
    (tmp_path / "run.json").write_text(text)
    with pytest.raises(ValueError, match=r"run\.json is damaged"):
        RunFolder(tmp_path)


def packed(columns: dict[str, Any]) -> bytes:
    return gzip.compress(json.dumps({"trace": columns}).encode())


SPOILT = [
    b"garbage", gzip.compress(b"{"), gzip.compress(b'{"trace": 3}'), packed({}), packed(trace() | {"x": [1.0]}),
    packed(trace(0)), packed(trace(time="noon")), packed(trace(time=-1.0)), packed(trace(predicted_red_light="much")),
    packed(trace(command=3)), packed(trace(throttle=2.0)), packed(trace(steer=-1.5)), packed(trace(brake="hard")),
]  # fmt: skip


@pytest.mark.parametrize("content", SPOILT, ids=range(len(SPOILT)))
def test_a_damaged_trace_is_named(content: bytes, tmp_path: Path) -> None:
    (tmp_path / "traces").mkdir()
    trace_path(tmp_path, "a").write_bytes(content)
    with pytest.raises(ValueError, match=r"damaged trace .*a\.json\.gz"):
        read_trace(tmp_path, "a")


@pytest.mark.parametrize("spoil", [lambda jpeg: b"", lambda jpeg: jpeg[: len(jpeg) // 2], lambda jpeg: jpeg[50:]])
def test_a_damaged_still_is_named(spoil: Callable[[bytes], bytes], tmp_path: Path) -> None:
    jpeg = simplejpeg.encode_jpeg(np.random.default_rng(0).integers(0, 255, (24, 48, 3), np.uint8))
    (tmp_path / "a-0.jpg").write_bytes(jpeg)
    assert read_still(tmp_path / "a-0.jpg") == jpeg
    (tmp_path / "a-0.jpg").write_bytes(spoil(jpeg))
    with pytest.raises(ValueError, match=r"found a damaged still .*a-0\.jpg .*remove it"):
        read_still(tmp_path / "a-0.jpg")


def test_the_description_says_what_drove(whole: BenchmarkSettings) -> None:
    description = json.loads((whole.out / "run.json").read_text())
    assert description["agent"] == "oracle"
    assert description["cap"] == 20.0
    assert description["code"] == code_version()


@pytest.fixture
def folder(whole: BenchmarkSettings, tmp_path: Path) -> RunFolder:
    """An empty folder of the same run."""
    (tmp_path / "run.json").write_bytes((whole.out / "run.json").read_bytes())
    return RunFolder(tmp_path)


@pytest.mark.parametrize("name", ["code", "model", "precision", "agent_source"])
def test_a_worker_that_drives_with_something_else_is_refused(name: str, folder: RunFolder) -> None:
    record = EpisodeRecord({"key": "a"}, {"traces/a.json.gz": b"x"}, {name: "other"})
    with pytest.raises(ValueError, match=f"worker with {name} other.*install the same caldrive and model"):
        folder.save(record)
    assert [path.name for path in folder.path.iterdir()] == ["run.json"]


def test_files_are_there_before_their_line(folder: RunFolder, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(run_folder, "append_line", lambda path, line: pytest.fail("was killed before the line"))
    with pytest.raises(pytest.fail.Exception):
        folder.save(EpisodeRecord({"key": "a"}, {"traces/a.json.gz": b"x"}, {}))
    assert (folder.path / "traces" / "a.json.gz").read_bytes() == b"x"
    assert folder.lines() == {}


def test_results_that_are_kept_may_be_compressed(whole: BenchmarkSettings, folder: RunFolder) -> None:
    packed_lines = gzip.compress((whole.out / "results.jsonl").read_bytes())
    (folder.path / "results.jsonl.gz").write_bytes(packed_lines)
    assert folder.results() == RunFolder(whole.out).results()
    (folder.path / "results.jsonl.gz").write_bytes(packed_lines[:-20])
    with pytest.raises(ValueError, match=r"results\.jsonl\.gz is damaged"):
        folder.lines()
