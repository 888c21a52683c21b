"""Hand-made traces for the tests of what is read from them."""

from __future__ import annotations

from typing import Any

import numpy as np


def trace(n: int = 600, /, **columns: Any) -> dict[str, list[Any]]:
    """A minute of driving east at 5 m/s on the centre line, with what is asked for instead."""
    plain: dict[str, Any] = {
        "time": np.arange(n) / 10, "x": np.arange(n) / 2, "y": 0.0, "speed": 5.0, "command": "straight",
        "state": "cruising", "true_center_distance": 0.0, "predicted_center_distance": 0.0, "true_relative_angle": 0.0,
        "predicted_relative_angle": 0.0, "true_hazard_stop": 0.0, "predicted_hazard_stop": 0.0, "true_red_light": 0.0,
        "predicted_red_light": 0.0, "true_vehicle_distance": 50.0, "predicted_vehicle_distance": 50.0,
        "true_speed_sign": None, "predicted_speed_sign": None, "route_done": np.arange(n) / 2, "speed_limit": 30.0,
        "road_limit": 30.0,
    }  # fmt: skip
    return {name: np.broadcast_to(np.array(value), n).tolist() for name, value in (plain | columns).items()}


def after(at: int, value: Any, before: Any = 0.0, n: int = 600) -> list[Any]:
    """A column of something that changes once."""
    return [before] * at + [value] * (n - at)
