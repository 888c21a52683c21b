"""Maps of the report: of few towns, however many were driven in."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from caldrive.benchmark.report import maps as of_towns
from caldrive.benchmark.report.maps import MISSED, MOST, maps
from caldrive.benchmark.report.page import report_page
from caldrive.benchmark.report.runs import BenchmarkRun
from caldrive.results import Infraction, InfractionKind
from caldrive.world.roads.towns import load_roads
from tests.benchmark.report.test_report import run

FAULT = Infraction(InfractionKind.SIDEWALK, time=1.0, x=100.0, y=90.0)


@pytest.fixture
def many(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> BenchmarkRun:
    """A run in 32 towns that look alike: in the k-th, k - 22 infractions, from the 23rd on."""
    monkeypatch.setattr(of_towns, "load_roads", lambda town: load_roads("town02"))
    results = []
    for k, result in enumerate(run("cal", tmp_path).results):
        trial = replace(result.trial, scenario=replace(result.trial.scenario, town=f"random:{k}"))
        infractions = (FAULT,) * max(0, k - 22)
        results.append(replace(result, trial=trial, episode=replace(result.episode, infractions=infractions)))
    return replace(run("cal", tmp_path), results=tuple(results))


def test_of_many_towns_the_worst_are_drawn_and_the_others_named(many: BenchmarkRun) -> None:
    html = maps([many])
    assert html.count("<svg") == MOST
    assert [f">random:{k}</text>" in html for k in range(32)] == [k > 25 for k in range(32)]
    assert "Something went wrong in 9 of 32 towns." in html
    assert "left out: random:23, random:24, random:25." in html


def test_a_report_on_many_towns_stays_below_three_megabytes(many: BenchmarkRun) -> None:
    assert len(report_page([many, replace(many, name="oracle")]).encode()) < 1_500_000


def test_hundreds_of_infractions_take_no_more_room_than_a_few(tmp_path: Path) -> None:
    few = run("cal", tmp_path)
    bad = [
        replace(one, episode=replace(one.episode, infractions=tuple(replace(FAULT, x=k / 9) for k in range(300))))
        for one in few.results
    ]
    assert len(maps([replace(few, results=tuple(bad))])) < 300_000


def test_without_a_failure_there_is_no_map(tmp_path: Path) -> None:
    sound = [replace(one, episode=replace(one.episode, infractions=())) for one in run("cal", tmp_path).results]
    assert maps([replace(run("cal", tmp_path), results=tuple(sound))]) == ""


def test_every_kind_of_infraction_has_a_color() -> None:
    assert set(of_towns.COLORS) == {kind.value for kind in InfractionKind} | {MISSED}
