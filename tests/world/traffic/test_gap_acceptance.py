"""Who steps on the road before which car."""

from __future__ import annotations

import math

import numpy as np
import pytest

from caldrive.datatypes import Pose, VehicleState
from caldrive.geometry import boxes_of
from caldrive.world.traffic.gap_acceptance import bumps, may_walk


def may(car: VehicleState, x: float, y: float, dx: float, dy: float, pace: float = 1.2, bold: bool = False) -> bool:
    """Whether somebody at (x, y) may walk (dx, dy)."""
    return bool(may_walk(np.array((x, y)), (dx, dy), pace, boxes_of([car]), bold))


def car(speed: float, heading: float = 0.0) -> VehicleState:
    return VehicleState(Pose(0, 0, heading), speed, length=4.2, width=1.8)


OVER_THE_LANE = (0.0, 7.0)  # m, from the kerb right of a car


@pytest.mark.parametrize(("ahead", "speed", "free"), [(25.0, 6.0, False), (60.0, 6.0, True), (25.0, 0.0, True)])
def test_people_reckon_with_a_slow_car_that_speeds_up_before_it_sees_them(
    ahead: float, speed: float, free: bool
) -> None:
    assert may(car(speed), 2.1 + ahead, -2.2, *OVER_THE_LANE) is free


@pytest.mark.parametrize("ahead", [4.0, 10.0, 20.0])
def test_nobody_steps_in_front_of_a_fast_car(ahead: float) -> None:
    assert not may(car(14.0), 2.1 + ahead, -2.2, *OVER_THE_LANE)


@pytest.mark.parametrize("ahead", [1.5, 4.0, 20.0])
def test_people_step_before_a_standing_car(ahead: float) -> None:
    assert may(car(0.0), 2.1 + ahead, -2.2, *OVER_THE_LANE)


def test_people_do_not_walk_into_the_side_of_a_standing_car() -> None:
    assert not may(car(0.0), 0.0, -2.2, *OVER_THE_LANE)


def test_people_step_behind_a_car_and_far_before_it() -> None:
    assert may(car(8.0), -6.0, -2.2, *OVER_THE_LANE)
    assert may(car(8.0), 60.0, -2.2, *OVER_THE_LANE)


def test_a_driver_at_30_can_stop_for_whoever_steps_out_before_him() -> None:
    speed = 30 / 3.6
    nearest = min(x for x in np.arange(2.2, 60, 0.1) if may(car(speed), x, -2.06, *OVER_THE_LANE))
    assert nearest - 2.1 > speed**2 / (2 * 8.0) + 0.2 * speed


def test_whoever_already_stands_in_a_cars_way_goes_on_out_of_it() -> None:
    assert may(car(10.0), 12.0, 0.5, 0.0, 3.0)


def test_people_walk_freely_along_the_sidewalk_and_away_from_the_road() -> None:
    assert may(car(14.0), 10.0, -3.5, 5.0, 0.0)
    assert may(car(14.0), 10.0, -3.5, 0.0, -2.0)


@pytest.mark.parametrize("heading", [0.0, 1.0, math.pi / 2, -2.5])
def test_the_look_before_a_step_does_not_depend_on_the_compass(heading: float) -> None:
    c, s = math.cos(heading), math.sin(heading)
    for ahead in (5.0, 25.0, 70.0):
        turned = [(c * x - s * y, s * x + c * y) for x, y in ((ahead, -2.5), OVER_THE_LANE)]
        assert may(car(10.0, heading), *turned[0], *turned[1]) == may(car(10.0), ahead, -2.5, *OVER_THE_LANE)


def test_whoever_stands_at_the_end_of_his_way_already_walks_on() -> None:
    assert may(car(10.0), 12.0, 0.5, 0.0, 0.0)


@pytest.mark.parametrize("kmh", [10, 15, 20, 25, 30])
def test_the_bold_step_out_before_the_ego_as_soon_as_one_who_brakes_at_once_can_stop(kmh: int) -> None:
    speed = kmh / 3.6
    free = [x for x in np.arange(0.0, 20.0, 0.1) if may(car(speed), 2.1 + x, -2.06, 0.0, 0.2, bold=True)]
    assert min(free) > speed**2 / (2 * 7.5) + 0.2 * speed
    assert min(free) < speed**2 / (2 * 6.5) + 0.3 * speed + 1.0


def test_the_bold_are_careful_with_others() -> None:
    boxes = boxes_of([VehicleState(Pose(-1e4, 0, 0)), car(5.5)])
    place = np.array((2.1 + 6.0, -2.06))
    assert not may_walk(place, (0.0, 0.2), 1.2, boxes, True)
    assert may_walk(place, (0.0, 0.2), 1.2, boxes_of([car(5.5)]), True)


@pytest.mark.parametrize(
    ("x", "y", "dx", "dy"), [(0.0, -1.4, 0.0, 0.14), (2.6, 0.0, -0.14, 0.0), (0.0, -1.3, 0.0, 0.14)]
)
def test_nobody_walks_into_a_standing_car(x: float, y: float, dx: float, dy: float) -> None:
    boxes = boxes_of([car(0.0)])
    assert bumps(np.array((x, y)), (dx, dy), boxes)
    assert not bumps(np.array((x, y)), (-dx, -dy), boxes)


def test_nobody_steps_before_a_car_that_cannot_stop_any_more_and_who_is_there_goes_on() -> None:
    boxes = boxes_of([car(5.5)])
    near, far, there = np.array((2.1 + 2.0, -1.4)), np.array((2.1 + 6.0, -1.4)), np.array((2.1 + 2.0, 0.5))
    assert bumps(near, (0.0, 0.14), boxes)
    assert not bumps(far, (0.0, 0.14), boxes)
    assert not bumps(there, (0.0, 0.14), boxes)
