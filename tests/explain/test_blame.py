"""Blame: failures go well again where the affordance that spoilt them is told."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from pathlib import Path

import pytest

from caldrive.affordances import BY_NAME
from caldrive.benchmark.report.runs import BenchmarkRun
from caldrive.explain.blame import ALL, ELSEWHERE, FOLDER, TOGETHER, Blame, blame, read_blame, tellings, with_blame
from tests.command_line import run_json


def test_each_affordance_is_told_alone_and_seen_alone() -> None:
    truths = {way.name: set(way.truth) for way in tellings()}
    assert len(truths) == 2 * len(BY_NAME) + 1
    assert truths["told-red_light"] == {"red_light"}
    assert truths["seen-red_light"] == BY_NAME.keys() - {"red_light"}
    assert truths[f"told-{ALL}"] == BY_NAME.keys()


def test_blame_says_in_words_what_a_failure_comes_from() -> None:
    nothing = dict.fromkeys(BY_NAME, ())
    found = Blame(("a", "b", "c"), {**nothing, "red_light": ("a",), ALL: ("a", "b")}, nothing)
    assert found.rest == ("c",)
    assert found.of("a").startswith("red light:")
    assert found.of("b") == "several affordances together"
    assert found.of("c").startswith("the controller or the world")
    assert [found.blamed(key) for key in "abc"] == [("red light",), (TOGETHER,), (ELSEWHERE,)]


def check_what_a_report_says(run: BenchmarkRun, found: Path) -> None:
    """A run whose folder holds what was found is blamed on the light; other results than the run's are a problem."""
    assert with_blame(run) is run
    moved = replace(run, folder=found.parent / "run")
    shutil.copytree(found, moved.folder / FOLDER)
    why = with_blame(moved).failures[0].explanation
    assert (why.blamed, why.alone) == (("red light",), ("red light",))
    assert why.blame.startswith("red light: the truth of it")
    for other in (replace(moved, results=()), replace(moved, description=moved.description | {"code": "behaviour-1"})):
        (problem,) = with_blame(other).problems
        assert "of other results, wanted those of now: remove it, and type caldrive blame" in problem
    shutil.rmtree(moved.folder / FOLDER / "seen-red_light")
    unfinished = with_blame(moved)
    assert unfinished.problems[0].startswith("blame: found all episodes in")
    assert not unfinished.explanations


def test_a_driver_who_sees_no_light_is_rescued_by_it_alone(blind_run: Path, tmp_path: Path) -> None:
    found, run = blame(blind_run, tmp_path, workers=1)
    assert (len(run.results), found.failures, found.rest) == (1, ("light",), ())
    assert {name for name, keys in found.rescued.items() if keys} == {"red_light", ALL}
    assert found.of("light").startswith("red light:")
    assert {name for name, keys in found.spoilt.items() if keys} == {"red_light"}
    before = (tmp_path / "told-all" / "results.jsonl").read_bytes()
    answer = run_json("blame", str(blind_run), "--out", str(tmp_path), "--workers", "1")  # nothing is driven again
    assert (answer["episodes"], answer["rest"]) == (1, [])
    assert (tmp_path / "told-all" / "results.jsonl").read_bytes() == before
    check_what_a_report_says(run, tmp_path)
    (tmp_path / "told-all" / "results.jsonl").unlink()
    with pytest.raises(ValueError, match=r"found 1 episodes in .*told-all that are not driven"):
        read_blame(tmp_path)


def test_a_run_of_other_code_is_refused(blind_run: Path, tmp_path: Path) -> None:
    copy = tmp_path / "run"
    shutil.copytree(blind_run, copy)
    about = json.loads((copy / "run.json").read_text())
    (copy / "run.json").write_text(json.dumps(about | {"code": "behaviour-1"}))
    with pytest.raises(ValueError, match="results with code behaviour-1, wanted behaviour"):
        blame(copy, tmp_path / "blame")
    assert not (tmp_path / "blame").exists()
