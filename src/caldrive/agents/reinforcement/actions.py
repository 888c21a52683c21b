"""Actions as the car takes them: the same code in training and at the wheel."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np

from caldrive.datatypes import Control

Action = Literal["continuous", "carla2017"]
# The paper's RL, (throttle, steering to the right): never both; below 0 the throttle brakes.
CARLA2017 = ((0, 0), (-1, 0), (-0.5, 0), (0.5, 0), (1, 0), (0, -1), (0, -0.5), (0, 0.5), (0, 1))
N_CONTINUOUS = 2  # throttle (below 0 the brake), and steering (+ to the left)


def control_of(kind: Action, action: Any) -> Control:
    """An action as a control: the number of one of CARLA2017, or throttle and steering, of which what lies outside
    [-1, 1] is cut."""
    if kind == "carla2017":
        throttle, right = CARLA2017[int(action)]
        return _control(throttle, -right)
    throttle, steer = np.clip(np.asarray(action, dtype=float), -1.0, 1.0).tolist()
    return _control(throttle, steer)


def _control(throttle: float, steer: float) -> Control:
    return Control(throttle=max(throttle, 0.0), brake=max(-throttle, 0.0), steer=steer)
