"""Same scenario, same bytes: drives an episode in two fresh processes and compares them step by step."""

from __future__ import annotations

import hashlib
import multiprocessing
from concurrent.futures import ProcessPoolExecutor
from contextlib import closing
from dataclasses import dataclass
from itertools import zip_longest
from typing import Any

from caldrive.datatypes import DT, Step
from caldrive.driving.settings import DeterminismSettings
from caldrive.progress import Progress, silent

PARTS = ("image", "truth", "decision", "control")


@dataclass(frozen=True)
class EpisodeDigests:
    """What one process drove, in short."""

    steps: tuple[tuple[str, ...], ...]
    """For each step a digest of each of PARTS."""
    result: str
    """The digest of the episode's result."""
    dt: float = DT
    """Seconds of a step."""


@dataclass(frozen=True)
class Comparison:
    """How two runs of one episode compare."""

    steps: int
    """How many were compared."""
    difference: str
    """In words; empty where both runs are equal."""
    digest: str
    """Of all of the first run."""

    @property
    def equal(self) -> bool:
        """Whether both runs have the same bytes."""
        return not self.difference


def check_determinism(settings: DeterminismSettings, progress: Progress = silent) -> Comparison:
    """Drive the scenario in two fresh processes, side by side but in CARLA, which has one world. Raises what driving
    raises."""
    progress("driving twice", 0.0)
    spawn = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(1 if settings.world == "carla" else 2, mp_context=spawn, max_tasks_per_child=1) as pool:
        first, second = pool.map(drive_and_digest, [settings, settings])
    return compare(first, second)


def drive_and_digest(settings: DeterminismSettings) -> EpisodeDigests:
    """Drive the scenario in this process, with the camera on."""
    from caldrive.driving.choice import chosen_scenarios
    from caldrive.driving.rollout import run_episode
    from caldrive.driving.setup import set_up

    [scenario] = chosen_scenarios(settings, 1)
    world, agent = set_up(settings, images=True)
    steps: list[tuple[str, ...]] = []
    with closing(world):
        result = run_episode(world, agent, scenario, lambda step: steps.append(step_digests(step)))
        return EpisodeDigests(steps=tuple(steps), result=digest(result), dt=world.dt)


def step_digests(step: Step) -> tuple[str, ...]:
    """One digest for each of PARTS."""
    return tuple(digest(value) for value in (step.observation.image, step.truth, step.decision, step.control))


def digest(value: Any) -> str:
    """SHA-256 over the bytes of an image or over every digit of other data."""
    content = value.tobytes() if hasattr(value, "tobytes") else repr(value).encode()
    return hashlib.sha256(content).hexdigest()


def compare(first: EpisodeDigests, second: EpisodeDigests) -> Comparison:
    """Equal, or the first step that differs and in what."""
    whole = hashlib.sha256(repr((first.steps, first.result)).encode()).hexdigest()
    for i, (one, other) in enumerate(zip_longest(first.steps, second.steps)):
        if one is None or other is None:
            return Comparison(steps=i, difference=f"one run ends after {i} steps, the other goes on", digest=whole)
        for part, a, b in zip(PARTS, one, other, strict=True):
            if a != b:
                difference = f"step {i} ({i * first.dt:.1f} s) differs in its {part}"
                return Comparison(steps=i, difference=difference, digest=whole)
    same = first.result == second.result
    difference = "" if same else "the results differ, though no step does"
    return Comparison(steps=len(first.steps), difference=difference, digest=whole)
