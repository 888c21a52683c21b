"""What an agent sees and does, as gymnasium's spaces, and back."""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium import spaces

from caldrive.datatypes import MAX_VEHICLE_DISTANCE, Affordances, Command, Control, Observation, Truth
from caldrive.gym.config import EnvConfig

COMMANDS = tuple(Command)
FASTEST = 50.0  # m/s
SIGNS = (None, 30, 60, 90)  # km/h
# The paper's RL, (throttle, steering to the right): never both; below 0 the throttle brakes.
CARLA2017 = ((0, 0), (-1, 0), (-0.5, 0), (0.5, 0), (1, 0), (0, -1), (0, -0.5), (0, 0.5), (0, 1))
N_AFFORDANCES = 5 + len(SIGNS)


def action_space(config: EnvConfig) -> spaces.Space[Any]:
    """Box(2) in [-1, 1]: throttle (below 0 the brake), steering (+ to the left); or Discrete(9)."""
    if config.action == "carla2017":
        return spaces.Discrete(len(CARLA2017))
    return spaces.Box(-1.0, 1.0, (2,), np.float32)


def control_of(config: EnvConfig, action: Any) -> Control:
    """An action as the car takes it; what lies outside [-1, 1] is cut."""
    if config.action == "carla2017":
        throttle, right = CARLA2017[int(action)]
        return _control(throttle, -right)
    throttle, steer = np.clip(np.asarray(action, dtype=float), -1.0, 1.0).tolist()
    return _control(throttle, steer)


def _control(throttle: float, steer: float) -> Control:
    return Control(throttle=max(throttle, 0.0), brake=max(-throttle, 0.0), steer=steer)


def observation_space(config: EnvConfig) -> spaces.Dict:
    """image (H, W, 3) in uint8, or affordances (9,) in [-1, 1]; speed (1,) in m/s; command, one of three, as ones and
    zeros."""
    camera = config.camera
    seen: dict[str, spaces.Space[Any]] = {
        "image": spaces.Box(0, 255, (camera.height, camera.width, 3), np.uint8),
        "affordances": spaces.Box(-1.0, 1.0, (N_AFFORDANCES,), np.float32),
    }
    return spaces.Dict(
        {
            config.observation: seen[config.observation],
            "speed": spaces.Box(0.0, FASTEST, (1,), np.float32),
            "command": spaces.Box(0, 1, (len(COMMANDS),), np.int8),
        }
    )


def observed(config: EnvConfig, observation: Observation, truth: Truth) -> dict[str, Any]:
    """An observation as the space has it."""
    seen = observation.image.copy() if config.observation == "image" else affordance_vector(truth.affordances)
    return {
        config.observation: seen,
        "speed": np.array([min(observation.speed, FASTEST)], np.float32),
        "command": np.array([observation.command is command for command in COMMANDS], np.int8),
    }


def affordance_vector(affordances: Affordances) -> np.ndarray[Any, np.dtype[np.float32]]:
    """Hazard stop, red light, distance as a share of 50 m, angle in rad, centre distance as a share of 2 m, and the
    sign as ones and zeros: none, 30, 60, 90 (9,)."""
    numbers = (
        affordances.hazard_stop, affordances.red_light, affordances.vehicle_distance / MAX_VEHICLE_DISTANCE,
        affordances.relative_angle, affordances.center_distance / 2,
        *(float(affordances.speed_sign == sign) for sign in SIGNS),
    )  # fmt: skip
    return np.clip(np.array(numbers, np.float32), -1.0, 1.0)
