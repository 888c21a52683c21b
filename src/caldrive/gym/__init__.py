"""caldrive as gymnasium environments: `caldrive.gym.register()`, then `gymnasium.make("caldrive/Town01-v0")`.

Needs `pip install 'caldrive[gym]'`.
"""

from __future__ import annotations

from functools import partial
from typing import Any

try:
    import gymnasium
    from gymnasium.vector import AsyncVectorEnv, AutoresetMode
except ModuleNotFoundError as error:
    raise ModuleNotFoundError("found no gymnasium, wanted it: type pip install 'caldrive[gym]'") from error

from caldrive.driving.rules import COLLISION
from caldrive.gym.config import EnvConfig
from caldrive.gym.env import DrivingEnv

__all__ = ["ENVIRONMENTS", "DrivingEnv", "EnvConfig", "make_env", "make_vec", "register"]

ENVIRONMENTS = {  # by id: the settings
    "caldrive/Town01-v0": EnvConfig(),
    "caldrive/Town02-v0": EnvConfig(towns=("town02",), weathers=tuple(range(1, 15)), held_out=True),
    "caldrive/Town01Traffic-v0": EnvConfig(tasks=("navigation-dynamic",)),
    "caldrive/Town01Affordances-v0": EnvConfig(observation="affordances"),
    "caldrive/Town01Carla2017-v0": EnvConfig(
        action="carla2017", reward="carla2017", rules="corl2017", ends=tuple(COLLISION.values())
    ),
}


def register() -> None:
    """Makes the environments known to `gymnasium.make`; a second time changes nothing."""
    for name, config in ENVIRONMENTS.items():
        if name not in gymnasium.registry:
            gymnasium.register(name, entry_point="caldrive.gym.env:DrivingEnv", kwargs={"config": config})


def make_env(name: str, **changes: Any) -> DrivingEnv:
    """An environment by its id. changes: of its settings, as for `DrivingEnv`. Raises ValueError for an unknown id."""
    if name not in ENVIRONMENTS:
        raise ValueError(f"found environment {name!r}, wanted one of {', '.join(ENVIRONMENTS)}: type one of these")
    return DrivingEnv(ENVIRONMENTS[name], **changes)


def make_vec(name: str, n: int, **changes: Any) -> AsyncVectorEnv:
    """n of them, each in a process of its own: only one world of a process may have traffic. An environment that has
    ended begins anew at the next step."""
    made = [partial(make_env, name, **changes)] * n
    return AsyncVectorEnv(made, context="forkserver", autoreset_mode=AutoresetMode.NEXT_STEP)
