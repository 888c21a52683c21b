"""What a drive looks like over time: the signals by which a controller is tuned."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.signal import savgol_filter

from caldrive.datatypes import KMH, Step
from caldrive.driving.comfort import WINDOW, Column
from caldrive.results import EpisodeResult


@dataclass(frozen=True)
class Signals:
    """One value a step of each, (N,). Acceleration and jerk are those of a parabola through seven steps, as in
    `driving.comfort`."""

    time: Column
    """s."""
    speed: Column
    """km/h."""
    target: Column
    """km/h, the speed that the controller aims at."""
    center_distance: Column
    """m to the centre line, + where it lies to the left."""
    relative_angle: Column
    """Degrees to the heading of the route, + to the left."""
    vehicle_distance: Column
    """m to the car ahead, from bumper to bumper."""
    throttle: Column
    """In [0, 1]."""
    brake: Column
    """In [0, 1]."""
    steer: Column
    """In [-1, 1], + to the left."""
    acceleration: Column
    """m/s² along the road."""
    jerk: Column
    """m/s³ along the road."""
    lateral_jerk: Column
    """m/s³ across it."""


@dataclass(frozen=True)
class Drive:
    """A drive: its signals, and the referee's result."""

    signals: Signals
    result: EpisodeResult


def signals(steps: Sequence[Step], dt: float) -> Signals:
    """The signals of steps dt seconds apart. Raises ValueError for fewer steps than a derivative needs."""
    if len(steps) < WINDOW:
        raise ValueError(f"found a drive of {len(steps)} steps, wanted {WINDOW} or more: let it last longer")
    speed = _column([step.truth.ego.speed for step in steps])
    heading = np.unwrap([step.truth.ego.pose.heading for step in steps])
    smooth, acceleration, jerk = (savgol_filter(speed, WINDOW, 2, deriv=k, delta=dt) for k in range(3))
    yaw_rate, yaw_acceleration = (savgol_filter(heading, WINDOW, 2, deriv=k, delta=dt) for k in (1, 2))
    seen = [step.truth.affordances for step in steps]
    targets = [step.decision.target_speed if step.decision else None for step in steps]
    return Signals(
        time=_column([step.truth.time for step in steps]),
        speed=speed / KMH,
        target=_column([math.nan if target is None else target for target in targets]),
        center_distance=_column([truth.center_distance for truth in seen]),
        relative_angle=np.degrees(_column([truth.relative_angle for truth in seen])),
        vehicle_distance=_column([truth.vehicle_distance for truth in seen]),
        throttle=_column([step.control.throttle for step in steps]),
        brake=_column([step.control.brake for step in steps]),
        steer=_column([step.control.steer for step in steps]),
        acceleration=acceleration,
        jerk=jerk,
        lateral_jerk=acceleration * yaw_rate + smooth * yaw_acceleration,
    )


def _column(values: Sequence[float]) -> Column:
    return np.asarray(values, dtype=float)
