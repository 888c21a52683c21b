"""How far the car has moved since the last look: its speed, and the wheel angle that it asked for."""

from __future__ import annotations

import math

from caldrive.datatypes import Pose

WHEELBASE, REAR_AXLE = 2.6, 1.3  # m; the rear axle lies behind the car's centre
MAX_ANGLE = 0.6109  # rad, the front wheels' at steer 1
TURN_RATE = 2.0  # rad/s with which they turn


def wheel_angle(angle: float, steer: float, dt: float) -> float:
    """The front wheels' angle (rad) after dt s, where steer is asked for."""
    wanted, most = steer * MAX_ANGLE, TURN_RATE * dt
    return angle + min(max(wanted - angle, -most), most)


def motion(speed: float, angle: float, dt: float) -> Pose:
    """The pose after dt s in the frame of the one before, by a bicycle; speed in m/s, angle of the wheels in rad."""
    way = speed * dt
    turn = way * math.tan(angle) / WHEELBASE
    half = turn / 2
    return Pose(
        way * math.cos(half) - REAR_AXLE * turn * math.sin(half),
        way * math.sin(half) + REAR_AXLE * turn * math.cos(half),
        turn,
    )  # fmt: skip
