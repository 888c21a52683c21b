"""Settings as frozen dataclasses. Presets are instances; nothing here computes."""

from __future__ import annotations

import math
from dataclasses import dataclass

from caldrive.datatypes import Control, Pose


@dataclass(frozen=True)
class VehicleConfig:
    """The ego: a compact car. Angles in rad, accelerations in m/s², times in s, mass in kg."""

    length: float = 4.2
    width: float = 1.8
    wheelbase: float = 2.6
    front_axle: float = 1.3  # m ahead of the centre
    max_steer: float = 0.6109  # 35°
    steer_rate: float = 2.0
    max_acceleration: float = 3.8  # at standstill; the thrust falls evenly to 0 at top_speed
    max_brake: float = 8.0
    top_speed: float = 45.0
    throttle_lag: float = 0.25
    brake_lag: float = 0.08
    max_lateral: float = 8.0  # m/s², what the tyres give before the car understeers
    drag: float = 0.0008  # 1/m
    rolling: float = 0.25
    mass: float = 1400.0


SUBSTEP = 0.01  # s


@dataclass(frozen=True)
class EgoState:
    """pose of the centre; speed along the heading (m/s); wheel angle (rad, + left); what throttle and brake really give
    in [0, 1]; mean acceleration along the heading over the last step (m/s²)."""

    pose: Pose
    speed: float = 0.0
    steer_angle: float = 0.0
    throttle_response: float = 0.0
    brake_response: float = 0.0
    acceleration: float = 0.0


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
    return EgoState(pose, speed, angle, throttle, brake, (speed - state.speed) / dt)
