"""The ego's motion: it accelerates, brakes and turns like a compact car."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from caldrive.datatypes import KMH, Control, Pose
from caldrive.world.traffic.ego import EgoState, VehicleConfig, advance

CAR = VehicleConfig()
CONTROLS = st.builds(Control, st.floats(0, 1), st.floats(0, 1), st.floats(-1, 1))


def at(speed: float, **rest: float) -> EgoState:
    return EgoState(Pose(0, 0, 0), speed=speed, **rest)


def run(state: EgoState, control: Control, seconds: float, config: VehicleConfig = CAR) -> EgoState:
    for _ in range(round(seconds / 0.1)):
        state = advance(state, control, 0.1, config)
    return state


def test_reaches_50_kmh_in_about_five_seconds() -> None:
    assert run(at(0), Control(throttle=1), 4.5).speed < 50 * KMH < run(at(0), Control(throttle=1), 5.5).speed


def test_reaches_90_kmh_but_not_its_top_speed() -> None:
    assert 90 * KMH < run(at(0), Control(throttle=1), 60).speed < CAR.top_speed


def test_full_brake_is_8_and_stops_without_reversing() -> None:
    state = run(at(20, brake_response=1.0), Control(brake=1), 1.0)
    assert state.acceleration == pytest.approx(-8 - CAR.rolling, abs=0.4)
    stopped = run(state, Control(brake=1), 5.0)
    assert stopped.speed == 0.0
    assert run(stopped, Control(brake=1), 5.0).pose == stopped.pose


def test_stops_from_30_kmh_within_the_red_light_area() -> None:
    assert run(at(30 * KMH), Control(brake=1), 5.0).pose.x < 6.6 - 0.1 * 30 * KMH


def test_rear_axle_circles_at_the_radius_of_the_wheel_angle() -> None:
    slow = replace(CAR, rolling=0.0, drag=0.0)
    state = at(2.0, steer_angle=CAR.max_steer / 2)
    end = run(state, Control(steer=0.5), 3.0, slow)
    radius = CAR.wheelbase / math.tan(CAR.max_steer / 2)
    assert end.pose.heading == pytest.approx(6.0 / radius, abs=1e-6)
    rear = CAR.wheelbase - CAR.front_axle
    x, y = end.pose.x - rear * math.cos(end.pose.heading), end.pose.y - rear * math.sin(end.pose.heading)
    assert math.hypot(x + rear, y - radius) == pytest.approx(radius, abs=1e-3)


def test_understeers_beyond_its_grip() -> None:
    fast = at(25.0, steer_angle=0.3)
    after = advance(fast, Control(throttle=0.5, steer=0.5), 0.1, CAR)
    assert 25.0 * after.pose.heading / 0.1 == pytest.approx(CAR.max_lateral, rel=0.02)


def test_steering_takes_time() -> None:
    assert advance(at(5), Control(steer=1), 0.1, CAR).steer_angle == pytest.approx(CAR.steer_rate * 0.1)
    assert run(at(5), Control(steer=1), 1.0).steer_angle == pytest.approx(CAR.max_steer)


@given(st.floats(0, 30), CONTROLS)
def test_left_and_right_mirror_each_other(speed: float, control: Control) -> None:
    left = run(at(speed), control, 1.0)
    right = run(at(speed), replace(control, steer=-control.steer), 1.0)
    assert right.pose.x == pytest.approx(left.pose.x)
    assert right.pose.y == pytest.approx(-left.pose.y)
    assert right.speed == left.speed >= 0


@given(st.floats(0, 30), CONTROLS)
def test_two_half_steps_are_one_step(speed: float, control: Control) -> None:
    whole = advance(at(speed), control, 0.2, CAR)
    halves = run(at(speed), control, 0.2)
    assert halves.pose.x == pytest.approx(whole.pose.x, abs=1e-9)
    assert halves.speed == pytest.approx(whole.speed, abs=1e-9)
