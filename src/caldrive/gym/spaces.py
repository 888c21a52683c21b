"""What an agent sees and does, as gymnasium's spaces."""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium import spaces

from caldrive.agents.reinforcement.config import CARLA2017, N_AFFORDANCES, N_COMMANDS, N_CONTINUOUS
from caldrive.agents.reinforcement.inputs import affordance_vector
from caldrive.datatypes import Command, Observation, Truth
from caldrive.gym.config import EnvConfig

FASTEST = 50.0  # m/s


def action_space(config: EnvConfig) -> spaces.Space[Any]:
    """Box(2) in [-1, 1]: throttle (below 0 the brake), steering (+ to the left); or Discrete(9)."""
    if config.action == "carla2017":
        return spaces.Discrete(len(CARLA2017))
    return spaces.Box(-1.0, 1.0, (N_CONTINUOUS,), np.float32)


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
            "command": spaces.Box(0, 1, (N_COMMANDS,), np.int8),
        }
    )


def observed(config: EnvConfig, observation: Observation, truth: Truth) -> dict[str, Any]:
    """An observation as the space has it."""
    seen = observation.image.copy() if config.observation == "image" else affordance_vector(truth.affordances)
    return {
        config.observation: seen,
        "speed": np.array([min(observation.speed, FASTEST)], np.float32),
        "command": np.array([observation.command is command for command in Command], np.int8),
    }
