"""Actions as the car takes them: the same code in training and at the wheel."""

from __future__ import annotations

from typing import Any

import numpy as np

from caldrive.agents.reinforcement.config import CARLA2017, Action
from caldrive.datatypes import Control


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
