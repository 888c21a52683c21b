"""Blame: failures go well again where the affordance that spoilt them is told."""

from __future__ import annotations

import io
import json
import re
import shutil
from dataclasses import replace
from pathlib import Path

import pytest
from rich.console import Console

from caldrive.affordances import BY_NAME
from caldrive.benchmark.report.runs import BenchmarkRun
from caldrive.benchmark.runner import benchmark
from caldrive.benchmark.settings import BenchmarkSettings
from caldrive.benchmark.suites import Trial, suite, to_json
from caldrive.commands.explain_tables import blame_table
from caldrive.explain.blame import (
    ALL,
    CHANCE,
    CONTROL,
    ELSEWHERE,
    FOLDER,
    ONE_OF,
    SUITE,
    TOGETHER,
    Blame,
    blame,
    read_blame,
    tellings,
    with_blame,
)
from tests.command_line import run_json

NOTHING = dict.fromkeys((*BY_NAME, ALL), ())
STANDS = """
from caldrive import Control

class Stands:
    camera = None

    def reset(self):
        pass

    def act(self, observation):
        return Control(brake=1.0)
"""


def test_each_affordance_is_told_alone_and_seen_alone() -> None:
    truths = {way.name: set(way.truth) for way in tellings()}
    assert len(truths) == 2 * len(BY_NAME) + 2
    assert truths[CONTROL] == set()
    assert truths["told-red_light"] == {"red_light"}
    assert truths["seen-red_light"] == BY_NAME.keys() - {"red_light"}
    assert truths[f"told-{ALL}"] == BY_NAME.keys()


def found_in(failures: str, **rescued: str) -> Blame:
    """What is found of failures with keys of one letter: those that the truth of an affordance rescues."""
    return Blame(tuple(failures), {**NOTHING, **{name: tuple(keys) for name, keys in rescued.items()}}, NOTHING)


def test_blame_says_in_words_what_a_failure_comes_from() -> None:
    found = found_in("abc", red_light="a", all="ab")
    assert found.rest == ("c",)
    assert found.of("a").startswith("red light:")
    assert found.of("b") == "several affordances together"
    assert found.of("c").startswith("the controller or the world")
    assert [found.blamed(key) for key in "abc"] == [("red light",), (TOGETHER,), (ELSEWHERE,)]


def test_each_failure_is_counted_once() -> None:
    found = found_in("abcdef", red_light="abd", hazard_stop="b", all="abcf")
    found = replace(found, by_chance=("f",), unlike=("e", "f"))
    counts = {name: count for name, count in found.shares().items() if count}
    assert counts == {"red light": 1, ONE_OF: 1, TOGETHER: 1, ELSEWHERE: 2, CHANCE: 1}
    assert found.rest == ("d", "e")  # what goes wrong with all told is not the light's
    console = Console(width=120, record=True, file=io.StringIO())
    console.print(blame_table(found, "cal", 9))
    text = console.export_text()
    rows = [re.split(r"\s{2,}", line.strip()) for line in text.splitlines()]
    shown = {row[0]: [int(text) for text in row[1:]] for row in rows if row[-1].isdigit()}
    assert (shown["red light"], shown["all of them"]) == ([1, 3, 0], [6, 4])
    assert sum(row[0] for name, row in shown.items() if name != "all of them") == len(found.failures)
    assert "2 of them did not go as before when they were driven again with nothing told" in text


def check_what_a_report_says(run: BenchmarkRun, found: Path) -> None:
    """A run whose folder holds what was found is blamed on the light; other results than the run's are a problem."""
    assert with_blame(run) is run
    moved = replace(run, folder=found.parent / "run")
    shutil.copytree(found, moved.folder / FOLDER)
    why = with_blame(moved).failures[0].explanation
    assert (why.counted, why.blamed, why.alone) == ("red light", ("red light",), ("red light",))
    assert why.blame.startswith("red light: the truth of it")
    for other in (replace(moved, results=()), replace(moved, description=moved.description | {"code": "behaviour-1"})):
        (problem,) = with_blame(other).problems
        assert "of other results, wanted those of now: remove it, and type caldrive blame" in problem
    (result,) = run.results
    shorter = replace(moved, results=(replace(result, episode=replace(result.episode, duration=1.0)),))
    assert with_blame(shorter).problems == (
        "blame: driven again with nothing told, failures that did not go as before: 1",
    )
    shutil.rmtree(moved.folder / FOLDER / "seen-red_light")
    unfinished = with_blame(moved)
    assert unfinished.problems[0].startswith("blame: found all episodes in")
    assert not unfinished.explanations


def test_a_driver_who_sees_no_light_is_rescued_by_it_alone(blind_run: Path, tmp_path: Path) -> None:
    found, run = blame(blind_run, tmp_path, workers=1)
    assert (len(run.results), found.failures, found.rest) == (1, ("light",), ())
    assert (found.unlike, found.by_chance) == ((), ())
    assert {name for name, keys in found.rescued.items() if keys} == {"red_light", ALL}
    assert found.of("light").startswith("red light:")
    assert {name for name, keys in found.spoilt.items() if keys} == {"red_light"}
    before = (tmp_path / "told-all" / "results.jsonl").read_bytes()
    answer = run_json("blame", str(blind_run), "--out", str(tmp_path), "--workers", "1")  # nothing is driven again
    assert (answer["episodes"], answer["rest"]) == (1, [])
    assert (tmp_path / "told-all" / "results.jsonl").read_bytes() == before
    check_what_a_report_says(run, tmp_path)
    suite = (tmp_path / SUITE).read_bytes()
    (tmp_path / SUITE).write_bytes(b"[]")  # of other failures
    with pytest.raises(ValueError, match=r"found in .* what was driven of other failures, .*: give another --out"):
        blame(blind_run, tmp_path, workers=1)
    assert (tmp_path / SUITE).read_bytes() == b"[]"
    (tmp_path / SUITE).write_bytes(suite)
    (tmp_path / "told-all" / "results.jsonl").unlink()
    with pytest.raises(ValueError, match=r"found 1 episodes in .*told-all that are not driven"):
        read_blame(tmp_path, run)


def test_a_run_of_other_code_is_refused(blind_run: Path, tmp_path: Path) -> None:
    copy = tmp_path / "run"
    shutil.copytree(blind_run, copy)
    about = json.loads((copy / "run.json").read_text())
    (copy / "run.json").write_text(json.dumps(about | {"code": "behaviour-1"}))
    with pytest.raises(ValueError, match="results with code behaviour-1, wanted behaviour"):
        blame(copy, tmp_path / "blame")
    assert not (tmp_path / "blame").exists()


def test_an_agent_without_affordances_is_refused_before_anything_is_written(tmp_path: Path) -> None:
    (tmp_path / "own.py").write_text(STANDS)
    trial = Trial("stands", "training", replace(suite("quick")[0].scenario, time_limit=1.0))
    (tmp_path / "suite.json").write_text(to_json([trial]))
    list(
        benchmark(
            BenchmarkSettings(
                suite=str(tmp_path / "suite.json"), out=tmp_path / "run", agent=f"{tmp_path / 'own.py'}:Stands",
                workers=1,
            )
        )
    )  # fmt: skip
    refused = run_json("blame", str(tmp_path / "run"), "--workers", "1", code=2)
    assert "found that the agent Stands gives no affordances, wanted one that does" in refused["error"]
    assert not (tmp_path / "run" / FOLDER).exists()


def test_a_run_of_another_version_is_reported_and_not_blamed(blind_run: Path, tmp_path: Path) -> None:
    copy = tmp_path / "run"
    shutil.copytree(blind_run, copy)
    about = json.loads((copy / "run.json").read_text())
    (copy / "run.json").write_text(json.dumps(about | {"code": "behaviour-1"}))
    assert "results with code behaviour-1" in run_json("blame", str(copy), code=2)["error"]
    assert run_json("report", str(copy), "--out", str(tmp_path / "report"))["failures"] == 1
    assert "| behaviour-1 |" in (tmp_path / "report" / "report.md").read_text()
    refused = run_json("report", str(copy), "--attention", "--out", str(tmp_path / "other"), code=2)
    assert "results with code behaviour-1" in refused["error"]
    assert not (tmp_path / "other").exists()
