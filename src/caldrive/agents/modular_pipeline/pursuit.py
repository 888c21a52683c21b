"""Waypoints to control: a PID for the wheel and one for the speed."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from caldrive.agents.modular_pipeline.odometry import REAR_AXLE
from caldrive.agents.modular_pipeline.waypoints import waypoint_ahead
from caldrive.control.pid import PIDGains, PIDState, pid_step
from caldrive.datatypes import KMH, Control, Points

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
