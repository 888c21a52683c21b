"""Several environments at once, each in a process of its own: only one world of a process may have traffic."""

from __future__ import annotations

from functools import partial
from typing import Any

from gymnasium.vector import AsyncVectorEnv, AutoresetMode

from caldrive.gym.env import DrivingEnv


def make_vec(name: str, n: int, **changes: Any) -> AsyncVectorEnv:
    """n environments of an id of `ENVIRONMENTS`. changes: of its settings, as for `DrivingEnv`.

    An environment that has ended begins anew at the next step. Raises ValueError for an unknown id.
    """
    return AsyncVectorEnv(
        [partial(make_env, name, **changes)] * n, context="forkserver", autoreset_mode=AutoresetMode.NEXT_STEP
    )


def make_env(name: str, **changes: Any) -> DrivingEnv:
    """One of them, in whatever process this is called."""
    from caldrive.gym import ENVIRONMENTS

    if name not in ENVIRONMENTS:
        raise ValueError(f"found environment {name!r}, wanted one of {', '.join(ENVIRONMENTS)}: type one of these")
    return DrivingEnv(ENVIRONMENTS[name], **changes)
