"""Contacts: what stops the car, what it slides along, and whose fault it is."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from caldrive.datatypes import ContactKind, PedestrianState, Pose, VehicleState
from caldrive.geometry import box_corners, boxes_overlap, push_out
from caldrive.world.traffic.collisions import CAR_MASS, PERSON_MASS, Obstacle, obstacle_of, resolve

EGO = VehicleState(Pose(0, 0, 0), speed=8.0, length=4.2, width=1.8, id="ego")
boxes = st.builds(
    lambda x, y, heading, length, width: box_corners(Pose(x, y, heading), length, width),
    st.floats(-4, 4), st.floats(-4, 4), st.floats(-3.1, 3.1), st.floats(0.3, 6), st.floats(0.3, 6),
)  # fmt: skip


def ego(speed: float, heading: float = 0.0) -> VehicleState:
    return replace(EGO, pose=Pose(0, 0, heading), speed=speed)


def wall(x: float, y: float, length: float = 0.4, width: float = 20.0) -> Obstacle:
    return Obstacle(ContactKind.OBJECT, "wall", Pose(x, y, 0.0), length=length, width=width)


def car(x: float, y: float, speed: float = 0.0, heading: float = 0.0) -> Obstacle:
    return obstacle_of(VehicleState(Pose(x, y, heading), speed, length=4.2, width=1.8, id="car"))


def person(x: float, y: float) -> Obstacle:
    return obstacle_of(PedestrianState(Pose(x, y, 0.0), id="person"))


def overlap(car: VehicleState, obstacle: Obstacle) -> bool:
    """Whether the boxes overlap by more than a micrometre."""
    slim = box_corners(car.pose, car.length - 1e-6, car.width - 1e-6)
    return boxes_overlap(slim, box_corners(obstacle.pose, obstacle.length, obstacle.width))


def test_nothing_near_changes_nothing() -> None:
    assert resolve(EGO, [wall(2.4, 0), car(0, 3), person(-3, 0)]) == (EGO, ())


def test_head_on_into_a_wall_stops_the_car_with_all_its_momentum() -> None:
    after, (contact,) = resolve(ego(8.0), [wall(2.2, 0.0)])
    assert after.speed == 0.0
    assert contact.impulse == pytest.approx(CAR_MASS * 8.0)
    assert (contact.kind, contact.id, contact.at_fault) == (ContactKind.OBJECT, "wall", True)
    assert (after.pose.x, after.pose.y) == pytest.approx((-0.1, 0.0))


def test_a_glancing_hit_slides_along_the_wall() -> None:
    long_wall = wall(0.0, 1.35, length=40.0, width=1.0)
    after, (contact,) = resolve(ego(8.0, heading=0.05), [long_wall])
    assert 7.9 < after.speed < 8.0
    assert contact.impulse == pytest.approx(CAR_MASS * 8.0 * math.sin(0.05))
    assert not overlap(after, long_wall)
    assert after.pose.y < 0


def test_a_car_that_only_touches_a_wall_beside_it_drives_on() -> None:
    assert resolve(ego(8.0), [wall(0.0, 1.4, length=40.0, width=1.0)]) == (ego(8.0), ())


def test_a_car_pushed_off_a_wall_does_not_hit_it_again() -> None:
    post = wall(1.0, 1.25, length=3.0, width=1.0)
    after, contacts = resolve(ego(8.0, heading=0.1), [post])
    assert contacts
    assert resolve(after, [post]) == (after, ())


def test_the_steeper_the_hit_the_more_speed_it_costs() -> None:
    speeds = [resolve(ego(8.0, heading=a), [wall(0, 2.0, 40.0, 1.0)])[0].speed for a in (0.2, 0.5, 0.8, 1.2)]
    assert speeds == sorted(speeds, reverse=True)
    assert speeds[0] - speeds[-1] > 3.0


def test_two_equal_cars_share_the_momentum_of_a_rear_end_hit() -> None:
    after, (contact,) = resolve(ego(8.0), [car(4.1, 0.0, speed=2.0)])
    assert after.speed == pytest.approx(5.0)
    assert contact.impulse == pytest.approx(CAR_MASS / 2 * 6.0)
    assert contact.at_fault


def test_two_cars_head_on_meet_with_their_closing_speed() -> None:
    _, (contact,) = resolve(ego(8.0), [car(4.1, 0.0, speed=6.0, heading=math.pi)])
    assert contact.impulse == pytest.approx(CAR_MASS / 2 * 14.0)


@pytest.mark.parametrize("speed", [0.0, 3.0], ids=["standing", "rolling"])
def test_being_run_into_from_behind_is_not_the_fault_of_the_ego_and_pushes_it_on(speed: float) -> None:
    after, (contact,) = resolve(ego(speed), [car(-4.1, 0.0, speed=9.0)])
    assert not contact.at_fault
    assert contact.impulse == pytest.approx(CAR_MASS / 2 * (9.0 - speed))
    assert after.speed == pytest.approx((9.0 + speed) / 2)
    assert after.pose.x == pytest.approx(0.1)


@pytest.mark.parametrize(
    ("obstacle", "fault"),
    [
        (car(0.5, 2.95, speed=8.0, heading=-math.pi / 2), False),  # from a side road into its front flank
        (car(0.5, 1.79, speed=10.0, heading=-0.3), False),  # cuts in
        (car(4.1, 0.0, speed=6.0, heading=math.pi), True),  # head on: others keep to their lane
        (car(1.0, 1.79, speed=6.0, heading=math.pi), True),  # along the flank of an oncoming one
        (car(2.9, 1.2, speed=0.0, heading=math.pi / 2), True),  # which stands across its way
    ],
    ids=["side road", "cuts in", "head on", "oncoming flank", "across"],
)
def test_who_is_run_into_is_not_at_fault(obstacle: Obstacle, fault: bool) -> None:
    _, (contact,) = resolve(ego(5.0), [obstacle])
    assert contact.at_fault is fault


def test_touching_something_that_draws_away_costs_nothing() -> None:
    after, (contact,) = resolve(ego(3.0), [car(4.1, 0.0, speed=9.0)])
    assert contact.impulse == 0.0
    assert after.speed == 3.0


def test_a_standing_ego_is_not_at_fault_for_a_car_or_a_person() -> None:
    for obstacle in (car(2.9, 1.5, speed=5.0, heading=-math.pi / 2), person(2.2, 0.0)):
        _, (contact,) = resolve(ego(0.0), [obstacle])
        assert not contact.at_fault


def test_a_person_before_the_bumper_is_hit_and_does_not_stop_the_car() -> None:
    after, (contact,) = resolve(ego(8.0), [person(2.2, 0.3)])
    assert after.speed == pytest.approx(8.0 * CAR_MASS / (CAR_MASS + PERSON_MASS))
    assert after.pose == EGO.pose
    assert (contact.kind, contact.at_fault) == (ContactKind.PERSON, True)
    assert contact.impulse == pytest.approx(8.0 * CAR_MASS * PERSON_MASS / (CAR_MASS + PERSON_MASS))


def test_a_person_who_walks_into_the_side_was_not_run_over() -> None:
    _, (contact,) = resolve(ego(8.0), [person(0.5, 1.1)])
    assert not contact.at_fault
    assert contact.impulse == pytest.approx(0.0, abs=1e-6)


def test_several_contacts_at_once_are_all_told_and_none_is_left_inside() -> None:
    walls = [wall(2.2, 0.0), wall(0.0, 1.3, length=20.0, width=1.0)]
    after, contacts = resolve(ego(8.0), walls)
    assert len(contacts) == 2
    assert not any(overlap(after, each) for each in walls)


@settings(max_examples=50)
@given(boxes, boxes)
def test_pushing_out_separates_and_no_shorter_push_along_it_does(moving: np.ndarray, fixed: np.ndarray) -> None:
    shift = push_out(moving, fixed)
    if shift is None:
        assert not boxes_overlap(moving, fixed)
        return
    assert boxes_overlap(moving, fixed)
    depth = np.linalg.norm(shift)
    if depth > 1e-3:
        assert not boxes_overlap(moving + shift * (1 + 1e-6 / depth), fixed)
        assert boxes_overlap(moving + shift * (1 - 1e-6 / depth), fixed)


@given(st.floats(0, 20), st.floats(-3.1, 3.1), st.floats(-3, 3), st.floats(-3, 3))
def test_no_wall_ever_speeds_the_car_up_or_keeps_it_inside(v: float, heading: float, x: float, y: float) -> None:
    post = wall(x, y, length=0.5, width=0.5)
    after, _ = resolve(ego(v, heading), [post])
    assert 0.0 <= after.speed <= v
    assert not overlap(after, post)


def test_a_corner_that_meets_a_corner_is_a_contact() -> None:
    post = wall(1.84375, 1.875, length=0.5, width=0.5)
    after, contacts = resolve(ego(0.0, heading=-2.75), [post])
    assert contacts
    assert not overlap(after, post)
