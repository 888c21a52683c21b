"""What is driven on the single road: each maneuver is mastered by the default controller, and its signals say so."""

from __future__ import annotations

from typing import get_args

import numpy as np
import pytest

from caldrive.control.presets import DEFAULT
from caldrive.results import Outcome
from caldrive.tune.config import CostWeights, ManeuverName
from caldrive.tune.constants import with_values
from caldrive.tune.cost import Cost, cost, mean_cost
from caldrive.tune.maneuvers import MANEUVERS, ROUTE_TASK, braking_car, drive, route
from caldrive.tune.signals import Drive, signals


@pytest.fixture(scope="module")
def drives() -> dict[str, Drive]:
    return {name: drive(maneuver, DEFAULT) for name, maneuver in MANEUVERS.items()}


def test_the_settings_name_the_maneuvers() -> None:
    assert get_args(ManeuverName) == tuple(MANEUVERS)


@pytest.mark.parametrize("name", MANEUVERS)
def test_the_default_controller_masters_it(name: str, drives: dict[str, Drive]) -> None:
    result = drives[name].result
    assert (result.outcome, result.infractions) == (Outcome.SUCCESS, ())


def test_a_step_of_the_limit_is_followed(drives: dict[str, Drive]) -> None:
    seen = drives["speed"].signals
    assert 59 < seen.speed.max() < 61.5
    assert seen.speed[-1] == pytest.approx(30, abs=1)
    assert set(seen.target) == {30.0, 60.0}


def test_the_car_waits_at_the_light_and_behind_the_other(drives: dict[str, Drive]) -> None:
    for name in ("light", "follow"):
        assert drives[name].signals.speed.min() < 0.1
    assert drives["follow"].signals.vehicle_distance.min() == pytest.approx(5.5, abs=0.5)


def test_turns_are_taken_slowly_and_near_the_line(drives: dict[str, Drive]) -> None:
    for name, side in (("left", 1), ("right", -1)):
        seen = drives[name].signals
        assert abs(seen.center_distance).max() < 0.2
        assert 0.2 < (side * seen.steer).max() <= 1


def test_the_car_ahead_brakes_to_a_stand_and_goes_on() -> None:
    speed = np.diff([braking_car(time) for time in np.arange(0, 30, 0.01)]) / 0.01 * 3.6
    assert (speed[0], speed[1200], speed[-1]) == pytest.approx((30, 0, 25), abs=0.1)
    assert np.diff(speed).min() / 0.01 / 3.6 == pytest.approx(-3.0, abs=0.05)


def test_acceleration_and_jerk_are_derivatives_of_the_speed(drives: dict[str, Drive]) -> None:
    seen = drives["light"].signals
    total = np.trapezoid(seen.acceleration, seen.time) * 3.6
    assert total == pytest.approx(seen.speed[-1] - seen.speed[0], abs=1.0)
    assert seen.acceleration.min() < -4  # it brakes for the light
    assert abs(seen.lateral_jerk).max() < 1e-6  # straight on


def test_a_cap_is_kept(drives: dict[str, Drive]) -> None:
    slow = drive(MANEUVERS["bend"], with_values(DEFAULT, {"cap": 20.0}))
    assert slow.signals.target.max() == 20.0
    assert slow.result.duration > drives["bend"].result.duration


def test_who_steers_badly_leaves_the_lane_and_pays_for_it(drives: dict[str, Drive]) -> None:
    bad = drive(MANEUVERS["left"], with_values(DEFAULT, {"lateral.left.damping": 1.0, "lateral.straight.damping": 1.0}))
    good, weights = cost(drives["left"]), CostWeights()
    assert bad.result.outcome is not Outcome.SUCCESS
    assert cost(bad).infractions >= 1
    assert cost(bad).total(weights) > good.total(weights) + 1


def test_a_cost_is_the_weighted_sum_of_its_parts() -> None:
    parts = mean_cost([Cost(1.0, 2.0, 3.0, 4.0), Cost(3.0, 2.0, 1.0, 0.0)])
    assert parts == Cost(2.0, 2.0, 2.0, 2.0)
    assert parts.total(CostWeights(time=1.0, jerk=0.5, center=0.0, infraction=2.0)) == pytest.approx(7.0)


def test_a_route_is_one_of_the_town_that_is_learnt_from() -> None:
    scenario = route(3).scenario
    assert (scenario.town, scenario.task, scenario.n_vehicles) == ("town01", ROUTE_TASK, 20)
    for town in ("town02", "random:9000000"):
        with pytest.raises(ValueError, match=r"found .* to learn from"):
            route(0, town)
    with pytest.raises(ValueError, match=r"found route 25 of town01, wanted 0 to 24"):
        route(25)


def test_a_drive_too_short_for_derivatives_is_refused() -> None:
    with pytest.raises(ValueError, match="found a drive of 0 steps, wanted 7 or more"):
        signals([], 0.1)
