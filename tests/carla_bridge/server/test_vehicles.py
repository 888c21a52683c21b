"""Vehicles that clients drive."""

from __future__ import annotations

import math

import msgspec
import pytest

from caldrive.carla_bridge.axes import Placement
from caldrive.carla_bridge.server.actors import description
from caldrive.carla_bridge.server.layouts import AckermannControl, VehicleControl
from caldrive.carla_bridge.server.vehicles import Vehicle, by_ackermann, drive, physics_of, set_physics
from caldrive.datatypes import Pose
from caldrive.world.traffic.ego import EgoState, VehicleConfig

CONFIG = VehicleConfig()


def driven(control: VehicleControl, seconds: float, speed: float = 0.0) -> EgoState:
    state = EgoState(Pose(0.0, 0.0, 0.0), speed)
    for _ in range(round(seconds / 0.05)):
        state = drive(state, control, 0.05, CONFIG)
    return state


def test_steering_to_the_right_leads_to_the_right() -> None:
    assert driven(VehicleControl(throttle=0.5, steer=0.3), 3.0).pose.y < -1.0


def test_reverse_drives_backwards() -> None:
    state = driven(VehicleControl(throttle=0.5, reverse=True), 3.0)
    assert state.pose.x < -3.0
    assert state.speed < -1.0
    assert state.pose.y == pytest.approx(0.0, abs=1e-6)


def test_backwards_with_the_wheel_to_the_right_the_rear_goes_to_the_right() -> None:
    state = driven(VehicleControl(throttle=0.4, steer=0.5, reverse=True), 3.0)
    assert state.pose.y < -0.3
    assert state.pose.heading > 0.1  # and the nose to the left


def test_a_way_back_in_the_same_tracks() -> None:
    """What drives ahead in an arc and back with the same wheels covers the same circle."""
    turning = EgoState(Pose(0.0, 0.0, 0.0), speed=2.0, steer_angle=0.2)
    steer = -0.2 / CONFIG.max_steer
    ahead = drive(turning, VehicleControl(steer=steer), 0.5, CONFIG)
    back = drive(EgoState(ahead.pose, -ahead.speed, 0.2), VehicleControl(steer=steer, reverse=True), 0.5, CONFIG)
    curvature = (ahead.pose.heading, (back.pose.heading - ahead.pose.heading))
    assert curvature[0] > 0 > curvature[1]
    assert math.hypot(back.pose.x, back.pose.y) < 0.15


def test_the_reverse_gear_brakes_what_drives_ahead() -> None:
    assert driven(VehicleControl(throttle=1.0, reverse=True), 0.5, speed=10.0).speed < 9.0


def test_the_hand_brake_holds() -> None:
    assert driven(VehicleControl(throttle=1.0, hand_brake=True), 1.0).speed < 0.1


def vehicle(**attributes: str) -> Vehicle:
    about = description("vehicle.audi.tt", **attributes)
    return Vehicle(1, about, Placement(), state=EgoState(Pose(0.0, 0.0, 0.0)))


def test_what_is_set_of_wheels_is_read_back_and_their_places_are_where_they_are() -> None:
    car = vehicle()
    wheels = tuple(msgspec.structs.replace(wheel, tire_friction=5.0) for wheel in physics_of(car).wheels)
    set_physics(car, msgspec.structs.replace(physics_of(car), wheels=wheels))
    car.put(Placement(x=10.0))
    found = physics_of(car).wheels
    assert [wheel.tire_friction for wheel in found] == [5.0] * 4
    assert found[0].position.x > 1000.0


@pytest.mark.parametrize(("sticky", "throttle"), [("true", 1.0), ("False", 0.0)])
def test_a_control_holds_until_the_next_one_or_for_a_step(sticky: str, throttle: float) -> None:
    car = vehicle(sticky_control=sticky)
    car.control = VehicleControl(throttle=1.0)
    car.step(0.1)
    assert car.state.speed > 0.0
    assert car.control.throttle == throttle


@pytest.mark.parametrize("speed", [3.0, 8.0, -2.0])
def test_the_ackermann_controller_reaches_its_speed(speed: float) -> None:
    state = EgoState(Pose(0.0, 0.0, 0.0))
    for _ in range(300):
        state = drive(state, by_ackermann(AckermannControl(speed=speed), state, CONFIG), 0.05, CONFIG)
    assert state.speed == pytest.approx(speed, abs=0.5)
