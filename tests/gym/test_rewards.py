"""Rewards of hand-made moments."""

from __future__ import annotations

from dataclasses import replace

import pytest

from caldrive.datatypes import (
    Affordances,
    Contact,
    ContactKind,
    Control,
    LightState,
    PedestrianState,
    Pose,
    TrafficLight,
    Truth,
    VehicleState,
)
from caldrive.gym.rewards import PRESETS, Transition, wanted_speed

START = Truth(time=0.0, ego=VehicleState(Pose(0, 0, 0), 5.0, length=4.2), affordances=Affordances())
STILL = Control()


def rewards(preset: str, before: Truth, now: Truth, *, steer: float = 0.0, broke: bool = False) -> dict[str, float]:
    return PRESETS[preset].rewards(Transition(before, now, STILL, Control(steer=steer), broke), {})


def test_the_papers_reward_is_a_point_a_metre_and_takes_two_for_the_whole_car_on_the_sidewalk() -> None:
    crash = Contact(ContactKind.CAR, "car 1", impulse=5000.0, at_fault=True)
    slower = replace(START.ego, speed=4.0)
    now = replace(START, route_done=3.0, sidewalk_share=0.5, opposite_share=0.25, contacts=(crash,), ego=slower)
    assert rewards("carla2017", START, now) == pytest.approx(
        {"distance": 3.0, "speed": -0.18, "damage": -10.0, "sidewalk": -1.0, "opposite_lane": -0.5}
    )
    assert rewards("carla2017", now, START)["sidewalk"] == pytest.approx(1.0)


def test_who_drives_as_fast_as_wanted_in_the_middle_of_the_lane_has_a_point_a_step() -> None:
    now = replace(START, ego=replace(START.ego, speed=6.0))
    assert sum(rewards("roach", START, now).values()) == pytest.approx(1.0)
    aside = replace(now, affordances=Affordances(center_distance=1.0, relative_angle=-0.2))
    assert sum(rewards("roach", START, aside).values()) == pytest.approx(1.0 - 0.5 - 0.2)
    assert sum(rewards("roach", START, now, steer=0.3).values()) == pytest.approx(0.9)
    assert rewards("roach", START, now, broke=True)["end"] == pytest.approx(-7.0)


def test_the_wanted_speed_falls_to_nothing_before_cars_people_and_red_lights() -> None:
    assert wanted_speed(START) == pytest.approx(6.0)
    for distance, speed in ((50.0, 6.0), (6.3, 3.0), (3.0, 0.0)):
        assert wanted_speed(replace(START, affordances=Affordances(vehicle_distance=distance))) == pytest.approx(speed)
    for x, on_road, speed in (
        (20.0, True, 6.0),
        (8.5, True, 3.0),
        (5.0, True, 0.0),
        (5.0, False, 6.0),
        (-5.0, True, 6.0),
    ):
        person = PedestrianState(Pose(x, 0.5, 0), on_road=on_road)
        assert wanted_speed(replace(START, pedestrians=(person,))) == pytest.approx(speed)
    light = TrafficLight("a", Pose(7.5, -3, 0), LightState.RED, ((7.5, 1.8), (7.5, -1.8)))
    too_late = replace(START, lights=(light,))
    assert wanted_speed(too_late) == pytest.approx(3.0)
    assert wanted_speed(replace(too_late, affordances=Affordances(red_light=1.0))) == 0
    for other in (replace(light, state=LightState.GREEN), replace(light, pose=Pose(7.5, -3, 2.0))):
        assert wanted_speed(replace(START, lights=(other,))) == pytest.approx(6.0)


def test_weights_can_be_changed() -> None:
    transition = Transition(START, replace(START, route_done=2.0), STILL, STILL, broke=False)
    assert PRESETS["carla2017"].rewards(transition, {"distance": 500.0})["distance"] == pytest.approx(1.0)
