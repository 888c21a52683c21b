"""The ego: a bicycle model with lagging throttle and brake, a limited steering rate, and tyres of limited grip."""

from __future__ import annotations

import math
from dataclasses import dataclass

from caldrive.datatypes import Control, Pose

SUBSTEP = 0.01  # s


@dataclass(frozen=True)
class VehicleConfig:
    """A compact car. The defaults are those of the ego in all results."""

    length: float = 4.2
    """m."""
    width: float = 1.8
    """m."""
    wheelbase: float = 2.6
    """m between the axles."""
    front_axle: float = 1.3
    """m ahead of the centre."""
    max_steer: float = 0.6109
    """rad, the largest angle of the wheels: 35°."""
    steer_rate: float = 2.0
    """rad/s with which the wheels turn."""
    max_acceleration: float = 3.8
    """m/s² at standstill; the thrust falls evenly to 0 at top_speed."""
    max_brake: float = 8.0
    """m/s²."""
    top_speed: float = 45.0
    """m/s."""
    throttle_lag: float = 0.25
    """s, time constant of the throttle."""
    brake_lag: float = 0.08
    """s, time constant of the brake."""
    max_lateral: float = 8.0
    """m/s², what the tyres give before the car understeers."""
    drag: float = 0.0008
    """1/m, deceleration by the air for each (m/s)²."""
    rolling: float = 0.25
    """m/s², deceleration by the wheels."""


@dataclass(frozen=True)
class EgoState:
    """Where the ego is, how it moves, and what its actuators do."""

    pose: Pose
    """Of its centre."""
    speed: float = 0.0
    """m/s along the heading."""
    steer_angle: float = 0.0
    """rad, of the wheels, + to the left."""
    throttle_response: float = 0.0
    """What the throttle really gives, in [0, 1]."""
    brake_response: float = 0.0
    """What the brake really gives, in [0, 1]."""
    acceleration: float = 0.0
    """m/s² along the heading, mean over the last step."""


def _clip(value: float, most: float) -> float:
    """The value within [-most, most]."""
    return -most if value < -most else most if value > most else value


def advance(state: EgoState, control: Control, dt: float, config: VehicleConfig) -> EgoState:
    """The state dt seconds later under a constant control. The car never rolls backwards."""
    n = max(1, round(dt / SUBSTEP))
    h = dt / n
    throttle_share, brake_share = 1 - math.exp(-h / config.throttle_lag), 1 - math.exp(-h / config.brake_lag)
    thrust, fade, braking = config.max_acceleration, 1 / config.top_speed, config.max_brake
    drag, rolling, grip = config.drag, config.rolling, config.max_lateral
    wheelbase, rear = config.wheelbase, config.wheelbase - config.front_axle
    wanted_angle, most_turn = control.steer * config.max_steer, config.steer_rate * h
    x, y, heading = state.pose.x, state.pose.y, state.pose.heading
    speed, angle = state.speed, state.steer_angle
    throttle, brake = state.throttle_response, state.brake_response
    for _ in range(n):
        throttle += throttle_share * (control.throttle - throttle)
        brake += brake_share * (control.brake - brake)
        angle += _clip(wanted_angle - angle, most_turn)
        gain = thrust * throttle * (1 - speed * fade) - braking * brake - drag * speed * speed - rolling
        before, speed = speed, speed + h * gain
        if speed < 0:
            speed = 0.0
        mean = (before + speed) / 2
        # Beyond the tyres' grip the car understeers: lateral acceleration v² κ is all that they give.
        turn = h * mean * _clip(math.tan(angle) / wheelbase, grip / (mean * mean + 1e-9))
        # The rear axle rolls along the heading halfway through the turn; the centre swings around it.
        c, s = math.cos(heading + turn / 2), math.sin(heading + turn / 2)
        x += h * mean * c - rear * turn * s
        y += h * mean * s + rear * turn * c
        heading += turn
    pose = Pose(x, y, math.remainder(heading, math.tau))
    return EgoState(
        pose=pose,
        speed=speed,
        steer_angle=angle,
        throttle_response=throttle,
        brake_response=brake,
        acceleration=(speed - state.speed) / dt,
    )
