"""The paper's observations as statements: what is measured, and the verdict."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from caldrive.datatypes import Semantic
from caldrive.explain.interventions import INTERVENTIONS, NO_OUTLINES, ONLY_LEGS, ONLY_SHADOW, ONLY_TORSO
from caldrive.explain.observations import STATEMENTS, finding, lower_part, measured, outlines
from tests.explain.test_counterfactuals import case, probability

ROWS = 12


def test_the_road_ends_where_a_sidewalk_begins_and_not_at_a_car() -> None:
    semantics = np.full((20, 60), Semantic.ROAD, np.uint8)
    semantics[:, 40:] = Semantic.SIDEWALK
    semantics[5:15, 5:15] = Semantic.VEHICLE
    columns = np.flatnonzero(outlines(semantics).any(axis=0))
    assert columns.tolist() == [38, 39, 40, 41]


def test_the_lower_third_of_a_person() -> None:
    person = np.zeros((40, 20), bool)
    person[10:22, 5:9] = True
    assert np.flatnonzero(lower_part(person).any(axis=1)).tolist() == [18, 19, 20, 21]


@pytest.mark.parametrize(
    ("values", "verdict"),
    [
        ((0.2, 0.3, 0.25, 0.2, 0.3, 0.28), "true"),
        ((-0.2, -0.3, -0.25, -0.2, -0.3, -0.28), "false"),
        ((0.001, 0.002, 0.001, 0.002, 0.001), "false"),
        ((-0.5, 0.5, -0.4, 0.5, 0.4, -0.5), "not shown"),
        ((0.2, 0.3), "too few cases"),
        ((), "too few cases"),
    ],
)
def test_the_interval_alone_gives_the_verdict(values: tuple[float, ...], verdict: str) -> None:
    found = finding(STATEMENTS[0], list(enumerate(values)))
    assert (found.cases, found.verdict) == (len(values), verdict)


def changed(name: str, before: float, after: float) -> Any:
    (intervention, *_) = [one for one in INTERVENTIONS if one.name == name]
    return SimpleNamespace(intervention=intervention, after=probability(after), change=after - before)


def test_what_is_taken_away_speaks_for_the_class_as_far_as_it_falls() -> None:
    seen: Any = SimpleNamespace(case=case("hazard by a person"))
    changes = [changed(ONLY_SHADOW, 0.9, 0.3), changed(ONLY_LEGS, 0.9, 0.8), changed(ONLY_TORSO, 0.9, 0.2)]
    values = {statement.text: value for statement, value in measured(seen, changes)}
    assert values == pytest.approx({"Legs alone make a hazard likelier than a torso alone": 0.6})
    even = SimpleNamespace(now=np.ones((2, 2), np.float32))
    at_a_light: Any = SimpleNamespace(case=case("red light"), studio=FakeStudio(), attention=even)
    values = {statement.text: value for statement, value in measured(at_a_light, [changed(NO_OUTLINES, 0.9, 0.5)])}
    assert values["The road's outlines make a red light likelier"] == pytest.approx(0.4)
    assert values["At a red light the road's outlines draw attention"] == pytest.approx(0.0, abs=1e-6)


class FakeStudio:
    """Half a road, half a sidewalk."""

    def semantics(self, case: Any, intervention: Any = None) -> np.ndarray:
        return np.repeat([[Semantic.ROAD] * 20 + [Semantic.SIDEWALK] * 20], ROWS, axis=0).astype(np.uint8)
