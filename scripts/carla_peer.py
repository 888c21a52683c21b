"""Drives the same episodes in the embedded world and, through CARLA's protocol, in the embedded world's own server.

    python -m scripts.carla_peer --agent cal --tasks straight one-turn navigation

Prints how each episode of the quick suite in town01 went on both sides, and ends with 1 where outcomes differ. Lights
change at other times on the two sides, as a server's clock does not begin with an episode; so times differ. Who else
is there drives by CARLA's traffic manager on one side and by SUMO on the other.
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass

import tyro

from caldrive.benchmark.runner import make_referee
from caldrive.benchmark.suites import Trial, suite
from caldrive.driving.rollout import run_episode
from caldrive.driving.settings import DriverSettings
from caldrive.driving.setup import set_up
from caldrive.results import EpisodeResult

TOWN = "town01"


@dataclass(frozen=True)
class Options:
    """Which episodes, and who drives them."""

    agent: str = "cal"
    """As in caldrive drive."""
    tasks: tuple[str, ...] = ("straight", "one-turn", "navigation")
    """Of the quick suite; navigation-dynamic has cars and people."""
    episodes: int = 12
    """At most so many."""
    port: int = 2000
    """Of the server that is started."""


@contextmanager
def served(port: int, *more: str) -> Iterator[None]:
    """A server of the town while it is needed. Raises RuntimeError where it ends by itself."""
    command = [sys.executable, "-m", "caldrive", "serve-carla", "--town", TOWN, "--port", str(port), *more]
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True) as process:
        try:
            assert process.stderr is not None
            if not any("may connect" in line for line in process.stderr):
                raise RuntimeError("found that the server ended, wanted it to serve: type caldrive serve-carla")
            yield
        finally:
            process.terminate()


def drive(driver: DriverSettings, trials: list[Trial]) -> list[EpisodeResult]:
    """How each trial goes."""
    world, agent = set_up(driver)
    with closing(world):
        return [run_episode(world, agent, trial.scenario, referee=make_referee(driver, trial)) for trial in trials]


def said(result: EpisodeResult) -> str:
    """An outcome in a few words."""
    kinds = ", ".join(one.kind.value for one in result.infractions) or "no infraction"
    return f"{result.outcome.value}, {result.duration:.1f} s, {kinds}"


def main(options: Options) -> int:
    """Returns 1 where outcomes differ."""
    trials = [t for t in suite("quick") if t.scenario.town == TOWN and t.scenario.task in options.tasks]
    trials = trials[: options.episodes]
    here = drive(DriverSettings(agent=options.agent, cap=20.0), trials)
    with served(options.port):
        there = drive(DriverSettings(agent=options.agent, cap=20.0, world="carla", port=options.port), trials)
    for trial, embedded, through in zip(trials, here, there, strict=True):
        print(f"{trial.key}\n  embedded          {said(embedded)}\n  through protocol  {said(through)}")
    equal = sum(one.outcome is other.outcome for one, other in zip(here, there, strict=True))
    print(f"same outcome in {equal} of {len(trials)} episodes")
    return int(equal < len(trials))


if __name__ == "__main__":
    sys.exit(main(tyro.cli(Options)))
