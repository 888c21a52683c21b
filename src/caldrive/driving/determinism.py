"""Same scenario, same bytes: drives an episode in two fresh processes and compares them step by step."""

from __future__ import annotations

import hashlib
import multiprocessing
from concurrent.futures import ProcessPoolExecutor
from contextlib import closing
from dataclasses import dataclass
from itertools import zip_longest
from typing import Any

from caldrive.datatypes import Step
from caldrive.driving.settings import DeterminismSettings
from caldrive.progress import Progress, silent

PARTS = ("image", "truth", "decision", "control")


def digest(value: Any) -> str:
    """SHA-256 over the bytes of an image or over every digit of other data."""
    content = value.tobytes() if hasattr(value, "tobytes") else repr(value).encode()
    return hashlib.sha256(content).hexdigest()


def step_digests(step: Step) -> tuple[str, ...]:
    """One digest for each of PARTS."""
    return tuple(digest(value) for value in (step.observation.image, step.truth, step.decision, step.control))


@dataclass(frozen=True)
class Digests:
    """One process's episode: the digests of each step, and that of the result."""

    steps: tuple[tuple[str, ...], ...]
    result: str


@dataclass(frozen=True)
class Comparison:
    """steps: how many were compared. difference: in words, empty where both runs are equal. digest: over all of it."""

    steps: int
    difference: str
    digest: str

    @property
    def equal(self) -> bool:
        return not self.difference


def drive_and_digest(settings: DeterminismSettings) -> Digests:
    """Drive the scenario in this process, with the camera on."""
    from caldrive.driving.choice import chosen_scenarios
    from caldrive.driving.rollout import run_episode
    from caldrive.driving.setup import set_up

    [scenario] = chosen_scenarios(settings, 1)
    world, agent = set_up(settings, settings.world, images=True)
    steps: list[tuple[str, ...]] = []
    with closing(world):
        result = run_episode(world, agent, scenario, lambda step: steps.append(step_digests(step)))
    return Digests(tuple(steps), digest(result))


def compare(first: Digests, second: Digests, dt: float = 0.1) -> Comparison:
    """Equal, or the first step that differs and in what."""
    whole = hashlib.sha256(repr(first).encode()).hexdigest()
    for i, (one, other) in enumerate(zip_longest(first.steps, second.steps)):
        if one is None or other is None:
            said = f"one run ends after {i} steps, the other goes on"
            return Comparison(i, said, whole)
        for part, a, b in zip(PARTS, one, other, strict=True):
            if a != b:
                return Comparison(i, f"step {i} ({i * dt:.1f} s) differs in its {part}", whole)
    same = first.result == second.result
    return Comparison(len(first.steps), "" if same else "the results differ, though no step does", whole)


def check_determinism(settings: DeterminismSettings, progress: Progress = silent) -> Comparison:
    """Drive the scenario in two fresh processes side by side. Raises what driving raises."""
    progress("driving twice", 0.0)
    spawn = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(2, mp_context=spawn, max_tasks_per_child=1) as pool:
        first, second = pool.map(drive_and_digest, [settings, settings])
    return compare(first, second)
