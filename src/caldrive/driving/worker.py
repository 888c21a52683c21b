"""What a worker does: it drives one trial and sends back all that is kept of it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

from caldrive.datatypes import Step
from caldrive.driving.behaviour import Behaviour
from caldrive.driving.drivers import set_up
from caldrive.driving.ledger import provenance
from caldrive.driving.referee import Referee
from caldrive.driving.rollout import run_episode
from caldrive.driving.settings import DriverSettings
from caldrive.driving.suites import Trial
from caldrive.driving.trace import plain, result_values
from caldrive.driving.witness import Witness


@dataclass(frozen=True)
class TrialRecord:
    """What a worker sends back of a trial: its line, its files by their names, and what it drove with."""

    line: dict[str, Any]
    files: dict[str, bytes]
    provenance: dict[str, Any]


@lru_cache(maxsize=1)
def _set_up(driver: DriverSettings) -> Any:
    """One world, agent and provenance for each process."""
    return *set_up(driver), provenance(driver)


def drive_trial(driver: DriverSettings, trial: Trial) -> TrialRecord:
    """Drives one trial."""
    world, agent, driven_with = _set_up(driver)
    referee = Referee(trial.scenario, trial.fatal)
    behaviour, witness = Behaviour(), Witness(world, referee)

    def watch(step: Step) -> None:
        behaviour.add(step)
        witness.add(step)

    result = run_episode(world, agent, trial.scenario, watch, referee)
    figures = {name: plain(value) for name, value in behaviour.figures(result.infractions).items()}
    line = {"key": trial.key, "result": result_values(result), "figures": figures}
    return TrialRecord(line, witness.files(trial.key, result), driven_with)
