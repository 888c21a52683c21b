"""Drives the same episodes in the embedded world and, through CARLA's protocol, in the embedded world's own server.

    python -m scripts.carla_peer --agent cal --tasks straight one-turn navigation

Prints how each episode of the quick suite went on both sides, and ends with 1 where outcomes differ. Each
episode has a server of its own with the scenario's seed, so that the lights begin alike; the server's clock is about a
second ahead. Who else is there drives by CARLA's traffic manager on one side and by SUMO on the other.
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass, replace

import tyro

from caldrive.benchmark.runner import make_referee
from caldrive.benchmark.suites import Trial, suite
from caldrive.driving.rollout import run_episode
from caldrive.driving.settings import DriverSettings
from caldrive.driving.setup import set_up
from caldrive.driving.tasks import TASKS
from caldrive.results import EpisodeResult
from caldrive.scenarios import TOWNS, Scenario


@dataclass(frozen=True)
class Options:
    """Which episodes, and who drives them."""

    agent: str = "cal"
    """As in caldrive drive."""
    towns: tuple[str, ...] = TOWNS
    """Of the quick suite."""
    tasks: tuple[str, ...] = TASKS
    """Likewise; navigation-dynamic has cars and people."""
    port: int = 2000
    """Of the server that is started."""


@contextmanager
def served(port: int, scenario: Scenario, *options: str) -> Iterator[None]:
    """A server of a scenario's town and seed while it is needed. Raises RuntimeError where it ends by itself."""
    where = ["--town", scenario.town, "--seed", str(scenario.seed), "--port", str(port)]
    command = [sys.executable, "-m", "caldrive", "serve-carla", *where, *options]
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True) as process:
        try:
            assert process.stderr is not None
            if not any("may connect" in line for line in process.stderr):
                raise RuntimeError("found that the server ended, wanted it to serve: type caldrive serve-carla")
            yield
        finally:
            process.terminate()


def drive(driver: DriverSettings, trial: Trial) -> EpisodeResult:
    """How a trial goes."""
    world, agent = set_up(driver)
    with closing(world):
        return run_episode(world, agent, trial.scenario, referee=make_referee(driver, trial))


def said(result: EpisodeResult) -> str:
    """An outcome in a few words."""
    kinds = ", ".join(one.kind.value for one in result.infractions) or "no infraction"
    return f"{result.outcome.value}, {result.duration:.1f} s, {kinds}"


def main(options: Options) -> int:
    """Returns 1 where outcomes differ."""
    trials = [t for t in suite("quick") if t.scenario.town in options.towns and t.scenario.task in options.tasks]
    equal, driver = 0, DriverSettings(agent=options.agent, cap=20.0)
    for trial in trials:
        embedded = drive(driver, trial)
        with served(options.port, trial.scenario):
            through = drive(replace(driver, world="carla", port=options.port), trial)
        equal += embedded.outcome is through.outcome
        print(f"{trial.key}\n  embedded          {said(embedded)}\n  through protocol  {said(through)}", flush=True)
    print(f"same outcome in {equal} of {len(trials)} episodes")
    return int(equal < len(trials))


if __name__ == "__main__":
    sys.exit(main(tyro.cli(Options)))
