"""caldrive as gymnasium environments: `caldrive.gym.register()`, then `gymnasium.make("caldrive/Town01-v0")`.

Needs `pip install 'caldrive[gym]'`.
"""

from __future__ import annotations

try:
    import gymnasium
except ModuleNotFoundError as error:
    raise ModuleNotFoundError("found no gymnasium, wanted it: type pip install 'caldrive[gym]'") from error

from caldrive.gym.config import EnvConfig
from caldrive.gym.env import DrivingEnv

__all__ = ["ENVIRONMENTS", "DrivingEnv", "EnvConfig", "register"]

ENVIRONMENTS = {  # by id: the settings
    "caldrive/Town01-v0": EnvConfig(),
    "caldrive/Town02-v0": EnvConfig(towns=("town02",), weathers=tuple(range(1, 15))),
    "caldrive/Town01Traffic-v0": EnvConfig(tasks=("navigation-dynamic",)),
    "caldrive/Town01Affordances-v0": EnvConfig(observation="affordances"),
    "caldrive/Town01Carla2017-v0": EnvConfig(action="carla2017", reward="carla2017", rules="corl2017"),
}


def register() -> None:
    """Makes the environments known to `gymnasium.make`; a second time changes nothing."""
    for name, config in ENVIRONMENTS.items():
        if name not in gymnasium.registry:
            gymnasium.register(name, entry_point="caldrive.gym.env:DrivingEnv", kwargs={"config": config})
