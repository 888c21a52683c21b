"""Who steps on the road before which car."""

from __future__ import annotations

import math

import numpy as np
import pytest
import shapely

from caldrive.datatypes import Control, Pose, VehicleState
from caldrive.geometry import box_corners, boxes_of
from caldrive.world.traffic.ego import EgoState, VehicleConfig, advance
from caldrive.world.traffic.gap_acceptance import Cars, bumps, foreseen, is_clear, may_walk, watched


def may(
    car: VehicleState, x: float, y: float, dx: float, dy: float, *, bold: bool = False, curvature: float = 0.0
) -> bool:
    """Whether somebody at (x, y) may walk (dx, dy)."""
    return bool(may_walk(np.array((x, y)), (dx, dy), 1.2, Cars(boxes_of([car]), curvature, curvature), bold))


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
    cars = Cars(boxes_of([VehicleState(Pose(-1e4, 0, 0)), car(5.5)]))
    place = np.array((2.1 + 6.0, -2.06))
    assert not may_walk(place, (0.0, 0.2), 1.2, cars, True)
    assert may_walk(place, (0.0, 0.2), 1.2, Cars(boxes_of([car(5.5)])), True)


@pytest.mark.parametrize(
    ("x", "y", "dx", "dy"), [(0.0, -1.4, 0.0, 0.14), (2.6, 0.0, -0.14, 0.0), (0.0, -1.3, 0.0, 0.14)]
)
def test_nobody_walks_into_a_standing_car(x: float, y: float, dx: float, dy: float) -> None:
    cars = Cars(boxes_of([car(0.0)]))
    assert bumps(np.array((x, y)), (dx, dy), cars)
    assert not bumps(np.array((x, y)), (-dx, -dy), cars)


def test_nobody_steps_before_a_car_that_cannot_stop_any_more_and_who_is_there_goes_on() -> None:
    cars = Cars(boxes_of([car(5.5)]))
    near, far, there = np.array((2.1 + 2.0, -1.4)), np.array((2.1 + 6.0, -1.4)), np.array((2.1 + 2.0, 0.5))
    assert bumps(near, (0.0, 0.14), cars)
    assert not bumps(far, (0.0, 0.14), cars)
    assert not bumps(there, (0.0, 0.14), cars)


@pytest.mark.parametrize("curvature", [0.0, 0.14, -0.2])
def test_nobody_walks_into_a_standing_ego_whatever_its_wheels_point_at(curvature: float) -> None:
    """Its path bends, its body does not."""
    rng, body = np.random.default_rng(0), shapely.Polygon(box_corners(Pose(0, 0, 0), 4.2, 1.8))
    cars = Cars(boxes_of([car(0.0)]), curvature, curvature)
    for x, y, way in rng.uniform((-6, -5, 0), (8, 5, math.tau), (1200, 3)).tolist():
        place, step = np.array((x, y)), (0.13 * math.cos(way), 0.13 * math.sin(way))
        near = body.distance(shapely.Point(place))
        for _ in range(60 if 0.5 < near < 4 else 0):
            if may_walk(place, step, 1.3, cars, False) and not bumps(place, step, cars):
                place = place + step
        assert near <= 0.5 or body.distance(shapely.Point(place)) > 0.3


@pytest.mark.parametrize("speed", [0.0, 4.0])
@pytest.mark.parametrize("left", [-1.2, -0.3])
def test_whoever_is_before_a_car_may_leave(speed: float, left: float) -> None:
    """Or they and a car that waits for them would stand for ever."""
    cars, place = Cars(boxes_of([car(speed)])), np.array((2.1 + 0.3, left))
    assert not bumps(place, (0.0, -0.14), cars)
    assert bumps(place, (0.0, 0.14), cars)


@pytest.mark.parametrize("curvature", [0.0, 0.1, -0.2])
def test_whoever_waits_before_a_standing_car_may_leave_it_to_one_side(curvature: float) -> None:
    """However far before it they stand, and though both ways may lead a little nearer."""
    cars, rng = Cars(boxes_of([car(0.0)]), curvature, curvature), np.random.default_rng(0)
    for ahead, left, on, back, pace in rng.uniform((0.1, -1.3, -0.4, -0.4, 0.9), (1.5, 1.3, 0.4, 0.4, 3.2), (2000, 5)):
        place, step = np.array((2.1 + ahead, left)), 0.1 * pace
        ways = ((-step * math.sin(on), step * math.cos(on)), (-step * math.sin(back), -step * math.cos(back)))
        assert not all(bumps(place, way, cars) for way in ways)


def test_an_unsteady_driver_is_no_reason_to_be_careful() -> None:
    """Or the test would be easier for those who drive worse."""
    lately, place = 0.0, np.array((2.1 + 6.0, -2.06))
    for k in range(40):
        curvature = math.tan(0.03) / 2.6 * (-1) ** k
        path = foreseen(lately, curvature)
        assert may_walk(place, (0.0, 0.2), 1.2, Cars(boxes_of([car(5.5)]), *path), True)
        lately = watched(lately, curvature, 0.1)


def test_people_expect_no_turn_beyond_the_wheels_and_none_to_the_other_side_as_they_come_back() -> None:
    assert foreseen(0.0, 0.27)[1] == pytest.approx(0.27)
    assert foreseen(0.27, 0.05)[1] == 0.0
    assert foreseen(-0.02, 0.1)[1] > 0.1


TURN = 1 / 8.0  # 1/m
REAR_AXLE = 0.6 * 2.1  # m behind a car's middle


@pytest.mark.parametrize("side", [1, -1], ids=["left", "right"])
def test_people_look_along_the_path_of_an_ego_that_turns(side: int) -> None:
    def beside(angle: float, left: float) -> tuple[float, float]:
        """A place so far along the path, and so many m left of it where it turns left."""
        return (8.0 - left) * math.sin(angle) - REAR_AXLE, side * (8.0 - (8.0 - left) * math.cos(angle))

    there, onto = beside(0.8, 2.1), beside(0.8, 1.8)
    step = (onto[0] - there[0], onto[1] - there[1])
    assert may(car(4.0), *there, *step)
    assert not may(car(4.0), *there, *step, bold=True, curvature=side * TURN)
    near, nearer = beside(0.6, 1.4), beside(0.6, 1.3)
    step = (nearer[0] - near[0], nearer[1] - near[1])
    assert not bumps(np.array(near), step, Cars(boxes_of([car(4.0)])))
    assert bumps(np.array(near), step, Cars(boxes_of([car(4.0)]), side * TURN, side * TURN))


@pytest.mark.parametrize("side", [1, -1], ids=["left", "right"])
@pytest.mark.parametrize("coming_from", [4.2, -2.6], ids=["inside", "outside"])
@pytest.mark.parametrize("ahead", [1.0, 2.0, 3.0])
def test_an_ego_that_turns_touches_nobody_who_comes_to_its_side(side: int, coming_from: float, ahead: float) -> None:
    car = VehicleConfig()
    ego = EgoState(Pose(0, 0, 0), speed=4.0, steer_angle=side * math.atan(car.wheelbase / 7))
    control = Control(throttle=0.2, steer=ego.steer_angle / car.max_steer)
    person, clear = np.array((ahead, side * coming_from)), math.inf
    step = np.array((0.0, -0.13 * side * math.copysign(1.0, coming_from)))
    for _ in range(40):
        ego = advance(ego, control, 0.05, car)
        here = VehicleState(ego.pose, ego.speed, length=car.length, width=car.width)
        if not bumps(person, tuple(step.tolist()), Cars(boxes_of([here]), side / 7, side / 7)):
            person = person + step
        body = shapely.Polygon(box_corners(ego.pose, car.length, car.width))
        clear = min(clear, body.distance(shapely.Point(person)))
    assert 0.3 < clear < 1.5


def test_nobody_is_bold_before_an_ego_that_turns() -> None:
    bold, careful = (
        [x for x in np.arange(3.0, 14.0, 0.1) if may(car(5.5), x, -2.06, 0.0, 0.2, bold=bold, curvature=-0.025)]
        for bold in (True, False)
    )
    assert bold == careful
    assert not may(car(5.5), 2.1 + 8.0, -2.06, 0.0, 0.2, bold=False)
    assert may(car(5.5), 2.1 + 8.0, -2.06, 0.0, 0.2, bold=True)  # before one that drives straight on


@pytest.mark.parametrize("speed", [0.0, 1.0, 4.0])
@pytest.mark.parametrize(
    ("path", "place"), [((-0.15, -0.08), (5.0, -4.3)), ((0.0, -0.12), (3.0, -3.9))], ids=["turns", "begins to turn"]
)
def test_nobody_enters_the_path_of_an_ego_that_turns_and_may_drive_on(
    speed: float, path: tuple[float, float], place: tuple[float, float]
) -> None:
    """Its hazard area is straight, and sees them when they are 1.5 m before it."""
    assert not may_walk(np.array(place), (0.0, 0.3), 1.2, Cars(boxes_of([car(speed)]), *path), False)
    assert may_walk(np.array(place), (0.0, 0.3), 1.2, Cars(boxes_of([car(speed)])), False)


@pytest.mark.parametrize("curvature", [0.045, -0.045, 0.02])
def test_a_curved_path_is_as_long_as_it_is(curvature: float) -> None:
    """Who steps on a path may do so the same way ahead of the car on straight and curved ones."""

    def nearest(bend: float) -> float:
        for ahead in np.arange(3.0, 14.0, 0.1).tolist():
            angle = (ahead + REAR_AXLE) * bend
            x, y = (math.sin(angle) / bend - REAR_AXLE, (1 - math.cos(angle)) / bend) if bend else (ahead, 0.0)
            u, v = math.cos(angle), math.sin(angle)
            if may(car(3.0), x + 2.1 * v, y - 2.1 * u, -0.2 * v, 0.2 * u, curvature=bend):
                return float(ahead)
        return math.inf

    assert nearest(curvature) == pytest.approx(nearest(0.0), abs=0.35)


def test_a_way_across_is_clear_unless_a_car_stands_in_it() -> None:
    far = VehicleState(Pose(-1e4, 0, 0))
    for x, speed, free in ((0.0, 0.0, False), (2.6, 0.0, False), (6.0, 0.0, True), (0.0, 5.0, True)):
        ways = np.array((x, -4.0)), np.array((x, 4.0))
        assert is_clear(*ways, Cars(boxes_of([far, car(speed)]))) is free
