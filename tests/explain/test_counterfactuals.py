"""What a change changes: answers, and means with their intervals."""

from __future__ import annotations

import numpy as np
import pytest

from caldrive.datatypes import Pose, VehicleState
from caldrive.explain.activation_maps import Question, Reply
from caldrive.explain.cases import SITUATIONS, Case
from caldrive.explain.counterfactuals import Change, Counterfactual, different, effects, interval, says
from caldrive.explain.interventions import INTERVENTIONS, interventions_in
from caldrive.world.rendering.camera import SceneState

STATE = SceneState(1, VehicleState(Pose(0.0, 0.0, 0.0)))


def case(name: str, label: int | None = None, other: str | None = None) -> Case:
    (situation,) = [one for one in SITUATIONS if one.name == name]
    return Case(situation, "a", other, Question(situation.affordance, label=label), (STATE,))


def probability(value: float) -> Reply:
    return Reply("red light", value, value, 1)


def test_what_a_network_says_of_each_kind_of_affordance() -> None:
    assert says(case("red light"), probability(0.6))
    assert not says(case("red light"), probability(0.4))
    assert says(case("speed sign", label=60), Reply("speed sign 60", 0.4, 60.0, 2))
    assert not says(case("speed sign", label=60), Reply("speed sign 60", 0.4, 30.0, 2))
    assert says(case("car ahead"), Reply("vehicle distance", None, 12.0, 0))
    assert not says(case("car ahead"), Reply("vehicle distance", None, 48.0, 0))


def test_every_situation_has_a_change_and_a_control_needs_another_thing() -> None:
    assert {one.situation for one in INTERVENTIONS} == {one.name for one in SITUATIONS}
    alone, beside = interventions_in(case("hazard by a car")), interventions_in(case("hazard by a car", other="b"))
    assert [one.name for one in alone] == ["the car is away"]
    assert [one.thing(case("hazard by a car", other="b")) for one in beside] == ["a", "b"]


def test_an_effect_is_the_mean_over_cases_with_the_answers_that_flip() -> None:
    change = INTERVENTIONS[0]
    blank = np.zeros((2, 2, 3), np.uint8)

    def changed(episode: int, before: float, after: float, now: float) -> tuple[int, Change]:
        replies = probability(before), probability(after), probability(now)
        one = Counterfactual(case("red light"), change, *replies, different(blank, blank), blank)
        return episode, one.summary

    found = [changed(0, 0.9, 0.1, 0.8), changed(1, 0.7, 0.6, 0.2)]
    (effect,) = effects(found)
    assert (effect.cases, effect.episodes, effect.flipped, effect.flipped_now) == (2, 2, 1, 1)
    assert (effect.before, effect.after, effect.difference) == pytest.approx((0.8, 0.35, -0.45))
    assert effect.difference_now == pytest.approx(-0.3)
    assert effect.interval is None  # two episodes say nothing of others
    (effect,) = effects([changed(k, 0.9, 0.1 + 0.1 * (k % 2), 0.8) for k in range(6)])
    assert effect.interval is not None
    assert -0.8 <= effect.interval[0] < effect.difference < effect.interval[1] <= -0.7


def test_an_interval_is_wider_where_episodes_differ_than_where_cases_do() -> None:
    values = [0.0, 1.0] * 20
    by_case = [(k // 4, value) for k, value in enumerate(values)]
    by_episode = [(k % 10, value) for k, value in enumerate(values)]  # all of one episode are alike
    assert interval([(k, 0.3) for k in range(5)], 0) == pytest.approx((0.3, 0.3))
    assert interval([(k, 0.3) for k in range(4)], 0) is None
    narrow, wide = interval(by_case, 0), interval(by_episode, 0)
    assert wide is not None
    assert narrow == pytest.approx((0.5, 0.5))
    assert wide[0] < 0.3
    assert wide[1] > 0.7
    assert interval(by_episode, 0) == wide


def test_an_image_differs_where_it_is_seen_to() -> None:
    one = np.zeros((2, 2, 3), np.uint8)
    other = one.copy()
    other[0, 0, 1], other[1, 1, 2] = 255, 3
    assert different(one, other).tolist() == [[True, False], [False, False]]
