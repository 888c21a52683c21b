"""How many steps a second the gymnasium environment makes on this machine, alone or in several processes."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass
from time import perf_counter
from typing import Any

import numpy as np

from caldrive.checks import MOST_SEED, MOST_WORKERS, require_within
from caldrive.driving.settings import EnvSpeedSettings
from caldrive.driving.speed import MAX_STEPS, processor_name
from caldrive.driving.tasks import TASKS
from caldrive.gym import make_env, make_vec
from caldrive.gym.config import require_one_of
from caldrive.progress import Progress, silent

WARM_UP = 20  # steps that do not count
GENTLE = np.array([0.3, 0.0], np.float32)  # drives on, and now and then off the road: what ends an episode counts, too
Step = Callable[[], Any]


@dataclass(frozen=True)
class EnvTiming:
    """How fast environments are together."""

    processor: str
    """Its name."""
    steps_per_second: float
    """Of all environments together."""
    environments: int
    """How many there were."""


def measure_env(settings: EnvSpeedSettings, progress: Progress = silent) -> EnvTiming:
    """Drives with a gentle throttle. Raises ValueError for settings that cannot be."""
    require_within("--steps", settings.steps, 1, MAX_STEPS, 1000)
    require_within("--environments", settings.environments, 1, MOST_WORKERS, 4)
    require_within("--seed", settings.seed, 0, MOST_SEED, 0)
    require_one_of("task", settings.task, TASKS)
    options: dict[str, Any] = {"observation": settings.observation, "tasks": (settings.task,)}
    n = settings.environments
    several = n > 1
    env: Any = make_vec("caldrive/Town01-v0", n, **options) if several else make_env("caldrive/Town01-v0", **options)
    with closing(env):
        env.reset(seed=settings.seed)
        step: Step = (lambda: env.step(np.tile(GENTLE, (n, 1)))) if several else (lambda: _step_or_reset(env))
        for _ in range(WARM_UP):
            step()
        began = perf_counter()
        for k in range(settings.steps):
            step()
            progress("steps", k / settings.steps)
        seconds = perf_counter() - began
    return EnvTiming(processor_name(), n * settings.steps / seconds, n)


def _step_or_reset(env: Any) -> None:
    """A step, and a new episode where that ends one, as the environments in processes do by themselves."""
    _, _, terminated, truncated, _ = env.step(GENTLE)
    if terminated or truncated:
        env.reset()
