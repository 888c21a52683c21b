"""Waypoints to control, by a PID for the wheel and one for the speed; and the odometry: how far the car has moved."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from caldrive.control.pid import PIDGains, PIDState, pid_step
from caldrive.datatypes import KMH, Control, Points, Pose
from caldrive.world.traffic.ego import VehicleConfig

CAR = VehicleConfig()
REAR_AXLE = CAR.wheelbase - CAR.front_axle  # m behind the car's centre
STEERING = PIDGains(1.5, 0.0, 0.05)
"""Error in rad, to the waypoint from the rear axle."""
SPEED = PIDGains(0.32, 0.07, 0.0, low=-0.4)
"""Error in m/s; output throttle, or brake where negative."""
NEAR, TIME = 3.5, 0.5  # m, and s times the speed, from the rear axle to the waypoint that is steered to


@dataclass(frozen=True)
class PursuitState:
    """What the two remember."""

    steering: PIDState = field(default_factory=PIDState)
    speed: PIDState = field(default_factory=PIDState)


def pursue(
    waypoints: Points, speed: float, target: float, state: PursuitState, dt: float
) -> tuple[PursuitState, Control]:
    """The control along waypoints (N, 2) in the car's frame; speed in m/s, target in km/h."""
    x, y = waypoint_ahead(waypoints, (-REAR_AXLE, 0.0), NEAR + TIME * speed)
    steering, steer = pid_step(STEERING, state.steering, math.atan2(y, x + REAR_AXLE), dt)
    pid, effort = pid_step(SPEED, state.speed, target * KMH - speed, dt)
    return PursuitState(steering, pid), Control(max(effort, 0.0), max(-effort, 0.0), steer)


def waypoint_ahead(points: Points, origin: tuple[float, float], distance: float) -> tuple[float, float]:
    """The first of the points (N, 2) that lies ahead of an origin and at least so far from it, else the last."""
    d = points - origin
    far = np.flatnonzero((np.hypot(d[:, 0], d[:, 1]) >= distance) & (d[:, 0] > 0))
    x, y = points[far[0] if len(far) else -1].tolist()
    return x, y


def wheel_angle(angle: float, steer: float, dt: float) -> float:
    """The front wheels' angle (rad) after dt s, where steer is asked for."""
    wanted, most = steer * CAR.max_steer, CAR.steer_rate * dt
    return angle + min(max(wanted - angle, -most), most)


def motion(speed: float, angle: float, dt: float) -> Pose:
    """The pose after dt s in the frame of the one before, by a bicycle; speed in m/s, angle of the wheels in rad."""
    way = speed * dt
    turn = way * math.tan(angle) / CAR.wheelbase
    half = turn / 2
    return Pose(
        way * math.cos(half) - REAR_AXLE * turn * math.sin(half),
        way * math.sin(half) + REAR_AXLE * turn * math.cos(half),
        turn,
    )  # fmt: skip
