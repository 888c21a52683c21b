"""CARLA's axes and ours."""

from __future__ import annotations

import math
from dataclasses import astuple

import pytest

from caldrive.carla_bridge.axes import Placement, compose, from_carla, to_carla


def test_what_is_right_in_carla_is_right_here() -> None:
    place = from_carla(1.0, 2.0, 3.0, pitch=10.0, yaw=90.0, roll=5.0)
    assert (place.x, place.y, place.z) == (1.0, -2.0, 3.0)
    assert math.degrees(place.heading) == pytest.approx(-90.0)  # clockwise


def test_there_and_back_changes_nothing() -> None:
    numbers = (1.0, 2.0, 3.0, 10.0, 20.0, 30.0)
    assert to_carla(from_carla(*numbers)) == pytest.approx(numbers)


def test_what_is_attached_ahead_of_a_car_that_looks_left_lies_to_its_left() -> None:
    place = compose(Placement(10.0, 20.0, heading=math.pi / 2), Placement(x=2.0, y=0.0, z=1.0, pitch=0.1))
    assert astuple(place) == pytest.approx((10.0, 22.0, 1.0, math.pi / 2, 0.1, 0.0))


def test_what_hangs_before_a_nose_that_is_up_lies_higher() -> None:
    place = compose(Placement(pitch=math.radians(30.0)), Placement(x=2.0))
    assert (place.x, place.z) == pytest.approx((2 * math.cos(math.radians(30.0)), 1.0))


def test_a_tilted_parent_turns_its_child_as_itself() -> None:
    parent = Placement(heading=0.4, pitch=0.3, roll=0.2)
    assert astuple(compose(parent, Placement())) == pytest.approx(astuple(parent))


def test_the_right_side_of_what_rolls_to_the_right_is_down() -> None:
    assert compose(Placement(roll=math.radians(30.0)), Placement(y=-2.0)).z == pytest.approx(-1.0)
