"""Moments in which one thing decides: found where it does, and only there."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any, cast

import pytest

from caldrive.datatypes import Affordances, LightState, PedestrianState, Pose, Sign, TrafficLight, Truth, VehicleState
from caldrive.explain.cases import CAMERA, SITUATIONS, Moment, Subject
from caldrive.geometry import moved
from caldrive.world.town import Town

EGO = VehicleState(Pose(0.0, 0.0, 0.0), 3.0)
AXLE = moved(EGO.pose, forward=1.4)


def subject(situation: str, *, sun: float = 0.0, signs: tuple[Sign, ...] = (), **truth: Any) -> Subject | None:
    """What decides it for a car at the origin. truth: fields of Truth, and affordances by their names."""
    labels = {name: truth.pop(name) for name in list(truth) if name in Affordances.__dataclass_fields__}
    town = cast("Town", SimpleNamespace(signs=signs, appearance=SimpleNamespace(sun_azimuth=sun)))
    moment = Moment(Truth(0.0, EGO, Affordances(**labels), **truth), AXLE, town, weather=8)
    (row,) = [one for one in SITUATIONS if one.name == situation]
    return row.subject(moment)


def person(x: float, y: float, id: str = "p") -> PedestrianState:
    return PedestrianState(Pose(x, y, 0.0), id=id)


def car(x: float, y: float, id: str) -> VehicleState:
    return VehicleState(Pose(x, y, 0.0), id=id)


def light(x: float, y: float, state: LightState, id: str) -> TrafficLight:
    return TrafficLight(id, Pose(x, y, 0.0), state, ((0.0, 0.0), (0.0, 0.0)))


def test_one_person_in_the_way_decides_and_one_on_the_sidewalk_is_of_no_concern() -> None:
    beside = person(12.0, 5.0, "q")
    assert subject("hazard by a person", pedestrians=(person(6.0, 0.5), beside)) == ("p", "q")
    assert subject("hazard by a person", pedestrians=(person(6.0, 0.5),)) == ("p", None)
    assert subject("hazard by a person", pedestrians=(beside,)) is None


def test_where_two_are_in_the_way_neither_decides() -> None:
    assert subject("hazard by a person", pedestrians=(person(6.0, 0.5), person(5.0, 0.0, "q"))) is None
    assert subject("hazard by a person", pedestrians=(person(6.0, 0.5),), vehicles=(car(8.0, 0.0, "c"),)) is None


def test_a_light_decides_by_its_colour() -> None:
    red, green = (light(12.0, -3.0, state, "a") for state in (LightState.RED, LightState.GREEN))
    far = light(25.0, -3.0, LightState.RED, "b")
    assert subject("red light", lights=(red, far), red_light=1.0) == ("a", "b")
    same_post = light(12.0, -4.0, LightState.RED, "c")
    assert subject("red light", lights=(red, same_post), red_light=1.0) == ("a", None)
    assert subject("green light", lights=(green, far)) == ("a", "b")
    assert subject("green light", lights=(red,), red_light=1.0) is None
    assert subject("red light", lights=(green,)) is None


def test_a_car_alone_ahead_decides_how_far_it_is() -> None:
    ahead, beside, beyond = car(15.0, 0.0, "c"), car(15.0, 4.0, "d"), car(25.0, 0.0, "d")
    assert subject("car ahead", vehicles=(ahead, beside), vehicle_distance=11.0) == ("c", "d")
    assert subject("car ahead", vehicles=(ahead, beyond), vehicle_distance=11.0) is None
    near = (car(6.0, 0.0, "c"),)
    assert subject("hazard by a car", vehicles=near, hazard_stop=1.0) == ("c", None)
    aside = (car(7.0, 1.8, "c"),)  # where a hazard is, and yet not a car ahead
    assert subject("hazard by a car", vehicles=aside, hazard_stop=1.0) == ("c", None)
    assert subject("hazard by a car", vehicles=near) is None  # a car that is not on the way


def test_a_sign_is_named_by_its_number_among_the_towns() -> None:
    signs = (Sign(Pose(40.0, -3.0, 0.0), 60), Sign(Pose(12.0, -3.0, 0.0), 30), Sign(Pose(12.0, -3.0, math.pi), 90))
    assert subject("speed sign", signs=signs, speed_sign=30) == ("1", None)
    assert subject("speed sign", signs=signs) is None


@pytest.mark.parametrize(
    ("place", "sun", "falls_into_view"),
    [((3.0, 4.0), 90, True), ((3.0, 4.0), -90, False), ((8.0, 0.0), 90, False), ((3.0, 30.0), 90, False)],
)
def test_a_shadow_falls_into_view_where_the_sun_stands_beside_who_throws_it(
    place: tuple[float, float], sun: float, falls_into_view: bool
) -> None:
    found = subject("shadow of a person out of view", pedestrians=(person(*place),), sun=math.radians(sun))
    assert (found == ("p", None)) is falls_into_view
    ahead, left = place[0] - CAMERA.forward, place[1]
    assert not falls_into_view or abs(left) > ahead  # half of 90 degrees
