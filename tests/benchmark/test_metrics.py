from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from caldrive.benchmark.metrics import (
    Pair,
    cells,
    driving_score,
    infraction_rates,
    mean_comfort,
    mean_errors,
    paired,
    red_light_counts,
    route_completion,
    speeding,
    touch_rates,
    wilson,
)
from caldrive.benchmark.suites import Trial, TrialResult
from caldrive.datatypes import Pose
from caldrive.results import EpisodeResult, Infraction, InfractionKind, Outcome
from caldrive.scenarios import Scenario

SCENARIO = Scenario("town01", 1, Pose(0, 0, 0), Pose(1, 0, 0), task="one-turn")


def driven(
    outcome: Outcome = Outcome.SUCCESS, kinds: tuple[InfractionKind, ...] = (), done: float = 500.0, **change: Any
) -> TrialResult:
    """An episode of 60 s and 500 m with infractions of these kinds. done: m of a route of 1 km."""
    episode = EpisodeResult(
        scenario=replace(SCENARIO, **change), outcome=outcome, duration=60.0, distance=500.0, route_done=done,
        route_length=1000.0, infractions=tuple(Infraction(kind, time=1.0, x=0, y=0) for kind in kinds),
    )  # fmt: skip
    return TrialResult(Trial("a", "training", episode.scenario), episode, metrics={})


# Known intervals: Brown, Cai and DasGupta's formula by hand for 0, 5 and 25 of 25.
@pytest.mark.parametrize(
    ("successes", "n", "interval"), [(0, 25, (0.0, 0.1332)), (25, 25, (0.8668, 1.0)), (20, 25, (0.6087, 0.9114))]
)
def test_wilsons_interval_is_the_known_one(successes: int, n: int, interval: tuple[float, float]) -> None:
    assert wilson(successes, n) == pytest.approx(interval, abs=2e-4)


@given(st.integers(1, 500), st.data())
def test_wilsons_interval_holds_the_rate_and_mirrors(n: int, data: st.DataObject) -> None:
    k = data.draw(st.integers(0, n))
    low, high = wilson(k, n)
    assert 0 <= low <= k / n + 1e-9
    assert k / n - 1e-9 <= high <= 1
    assert wilson(n - k, n) == pytest.approx((1 - high, 1 - low), abs=1e-9)


def test_two_agents_are_compared_in_the_episodes_that_both_drove() -> None:
    won, lost = Outcome.SUCCESS, Outcome.TIMEOUT
    first = [driven(outcome, seed=seed) for seed, outcome in enumerate((won, won, won, lost, lost, won))]
    second = [driven(outcome, seed=seed) for seed, outcome in enumerate((won, lost, lost, won, lost))]
    pair = paired(first, second)
    assert (pair.both, pair.first_alone, pair.second_alone, pair.neither, pair.episodes) == (1, 2, 1, 1, 5)
    assert pair.p_value == 1.0


# By hand: twice the tail of a fair coin thrown as often as the two differ.
@pytest.mark.parametrize(("alone", "p"), [((0, 0), 1.0), ((5, 0), 2 / 32), ((0, 10), 2 / 1024), ((8, 2), 112 / 1024)])
def test_mcnemars_test_is_exact(alone: tuple[int, int], p: float) -> None:
    first, second = alone
    assert Pair(both=50, first_alone=first, second_alone=second, neither=3).p_value == pytest.approx(p)


def test_cells_count_by_condition_and_task() -> None:
    episodes = [driven(), driven(Outcome.TIMEOUT), driven(Outcome.FAILED, task="straight")]
    first, second = cells(episodes)
    assert (first.task, first.episodes, first.successes, first.percent) == ("one-turn", 2, 1, 50.0)
    assert (second.task, second.episodes, second.successes) == ("straight", 1, 0)
    assert first.completion == pytest.approx(0.75)


def test_only_a_goal_reached_without_a_fault_of_ones_own_is_clean() -> None:
    hit = Infraction(InfractionKind.COLLISION_CAR, 1.0, 0, 0, at_fault=False)
    by_others = replace(driven(), episode=replace(driven().episode, infractions=(hit,)))
    counted = cells([driven(), by_others, driven(Outcome.TIMEOUT), driven(kinds=(InfractionKind.SIDEWALK,))])
    assert [(cell.episodes, cell.successes, cell.clean) for cell in counted] == [(4, 3, 2)]


def test_the_way_covered_never_leaves_its_bounds() -> None:
    assert route_completion(driven(Outcome.TIMEOUT, done=-5.0)) == 0.0
    assert route_completion(driven(Outcome.TIMEOUT, done=2000.0)) == 1.0


def test_the_driving_score_is_the_leaderboards() -> None:
    assert driving_score(driven()) == 100
    assert driving_score(driven(Outcome.TIMEOUT)) == pytest.approx(50)
    assert driving_score(driven(kinds=(InfractionKind.COLLISION_PERSON,))) == pytest.approx(50)
    assert driving_score(driven(kinds=(InfractionKind.RED_LIGHT,) * 2)) == pytest.approx(100 / 1.8)
    assert driving_score(replace(driven(), metrics={"off_lane": 0.25})) == pytest.approx(75)


def test_kilometres_between_infractions_are_open_where_none_occurred() -> None:
    rates = {rate.kind: rate for rate in infraction_rates([driven(kinds=(InfractionKind.SIDEWALK,) * 2)] * 3)}
    assert rates[InfractionKind.SIDEWALK].km_between == "0.25"
    assert rates[InfractionKind.RED_LIGHT].km_between == "> 1.5"


def test_what_others_cause_counts_as_in_carla_and_apart_from_own_faults() -> None:
    hit = Infraction(InfractionKind.COLLISION_CAR, 1.0, 0, 0, at_fault=False)
    both = replace(driven(), episode=replace(driven().episode, infractions=(hit, replace(hit, at_fault=True))))
    counts = {rate.kind: (rate.count, rate.own) for rate in infraction_rates([both])}
    assert counts.pop(InfractionKind.COLLISION_CAR) == (2, 1)
    assert set(counts.values()) == {(0, 0)}


def test_touches_are_rated_apart_from_infractions() -> None:
    touch = Infraction(InfractionKind.COLLISION_PERSON, 1.0, 0, 0)
    touched = replace(driven(), episode=replace(driven().episode, touches=(touch,) * 3))
    assert {rate.kind: rate.count for rate in touch_rates([touched])} == {
        InfractionKind.COLLISION_PERSON: 3, InfractionKind.COLLISION_CAR: 0, InfractionKind.COLLISION_OBJECT: 0,
    }  # fmt: skip
    assert all(rate.count == 0 for rate in infraction_rates([touched]))


def test_a_cell_that_is_driven_several_times_has_a_deviation() -> None:
    def of(repetition: int, *outcomes: Outcome) -> list[TrialResult]:
        results = [driven(outcome) for outcome in outcomes]
        return [replace(result, trial=replace(result.trial, repetition=repetition)) for result in results]

    good, bad = Outcome.SUCCESS, Outcome.TIMEOUT
    assert cells(of(0, good, bad))[0].deviation is None
    (cell,) = cells(of(0, good, good) + of(1, good, bad) + of(2, bad, bad))
    assert (cell.percent, cell.deviation) == (50, pytest.approx(50))


def test_speeding_weighs_each_episode_by_its_time() -> None:
    slow = replace(driven(), episode=replace(driven().episode, duration=30.0))
    fast = replace(driven(), episode=replace(driven().episode, duration=10.0, speeding=0.4, worst_excess=7.0))
    assert speeding([slow, fast]) == (pytest.approx(0.1), 7.0)


def lasting(duration: float, metrics: dict[str, Any], **comfort: float) -> TrialResult:
    """An episode of so many seconds with these metrics."""
    result = driven()
    return replace(result, episode=replace(result.episode, duration=duration, comfort=comfort), metrics=metrics)


def test_comfort_weighs_each_episode_by_its_time() -> None:
    first = lasting(10.0, {}, center_distance=0.1, jerk=1.0, lateral_straight=1.0, lateral_turn=3.0, turning=10.0,
                    comfortable=1.0)  # fmt: skip
    second = lasting(30.0, {}, center_distance=0.3, jerk=3.0, lateral_straight=2.0, lateral_turn=9.0, turning=0.0,
                     comfortable=0.5)  # fmt: skip
    means = mean_comfort([first, second])
    assert means["center_distance"] == pytest.approx(0.2)  # the median of two
    assert means["jerk"] == pytest.approx(math.sqrt((10 * 1 + 30 * 9) / 40))
    assert means["lateral_straight"] == pytest.approx(2.0)  # the first one only turned
    assert means["lateral_turn"] == pytest.approx(3.0)  # the second one never did
    assert means["comfortable"] == pytest.approx((10 + 15) / 40)


def test_red_lights_are_those_stopped_for_and_those_run() -> None:
    ran = replace(driven(kinds=(InfractionKind.RED_LIGHT,)), metrics={"reds_obeyed": 0})
    assert red_light_counts([replace(driven(), metrics={"reds_obeyed": 3}), ran]) == (4, 1)


def test_errors_weigh_each_episode_by_its_time_where_something_was_seen() -> None:
    seen = [lasting(10.0, {"error/hazard_stop": 0.1}), lasting(30.0, {"error/hazard_stop": 0.3}), lasting(60.0, {})]
    assert mean_errors(seen) == {"hazard_stop": pytest.approx(0.25)}
