"""A search for the controller's constants with the least cost (Optuna's TPE); one that was stopped goes on.

Each trial draws all searched constants and drives the same maneuvers and routes of town01 in the same order; it is
pruned where its mean cost so far is worse than the median of those before it after as many drives. What wins is then
judged beside the controller that the search began with, also on routes that the search has not seen.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import chain
from pathlib import Path
from statistics import median
from typing import Any

from caldrive.checks import MOST_WORKERS, require_within, require_writable_folder
from caldrive.control.controller import ControlConfig
from caldrive.files import claim_folder, locked_folder
from caldrive.parallel.processes import parallel_map
from caldrive.parallel.trials import Draw, abandon, finished, mend_journal, open_journal, require_optuna
from caldrive.progress import Progress, silent
from caldrive.provenance import code_version
from caldrive.tune.config import TuneConfig
from caldrive.tune.constants import Constant, constants, values_of, with_values
from caldrive.tune.cost import Cost, cost, mean_cost
from caldrive.tune.maneuvers import MANEUVERS, Maneuver, drive, route

SETTINGS, STUDY = "tune.json", "constants"
NUMBER = "number"  # a trial's own; Optuna's also counts those that were killed
STARTUP_TRIALS = 10  # that have come to a drive before any is pruned there


@dataclass(frozen=True)
class Judged:
    """A controller's mean costs: where it was tuned, and on as many other routes (None for none)."""

    controller: ControlConfig
    tuned: Cost
    others: Cost | None


@dataclass(frozen=True)
class TuningResult:
    """What a search found: the controller before it and the best one, and how many trials there were."""

    before: Judged
    after: Judged
    trials: int
    pruned: int


def tune(
    config: TuneConfig, controller: ControlConfig, out: Path, workers: int = 1, progress: Progress = silent
) -> TuningResult:
    """Does the trials that the folder lacks, and judges the best.

    In the folder lie journal.log (Optuna's) and tune.json. Raises ValueError where what lies there belongs to another
    search, RuntimeError without Optuna.
    """
    require_optuna()
    require_within("--workers", workers, 1, MOST_WORKERS, 2)
    require_writable_folder(out)
    with locked_folder(out):
        about = {"code": code_version(), "controller": _changed_values(controller)}
        claim_folder(out / SETTINGS, config.decisive() | about, "a search")
        mend_journal(out)
        missing = missing_trials(out, config)
        work, total = partial(run_trial, out, config, controller), config.trials
        for done, _ in enumerate(parallel_map(work, missing, workers), total - len(missing) + 1):
            progress(f"trial {done} of {total}", done / total)
        return _findings(out, config, controller, workers, progress)


def _changed_values(controller: ControlConfig) -> dict[str, str]:
    """The constants that are not as usual."""
    usual = values_of(ControlConfig())
    return {name: str(value) for name, value in values_of(controller).items() if value != usual[name]}


def tuned_maneuvers(config: TuneConfig) -> list[Maneuver]:
    """What a search drives: the quick ones first, so that what is bad ends soon."""
    return [*(MANEUVERS[name] for name in config.maneuvers), *map(route, range(config.routes))]


def other_maneuvers(config: TuneConfig) -> list[Maneuver]:
    """What only judges."""
    return [route(number) for number in range(config.routes, 2 * config.routes)]


def open_study(out: Path, config: TuneConfig, number: int = 0) -> Any:
    """The study. number: of the trial that it is asked for next."""
    return open_journal(out, STUDY, "minimize", Draw("tpe", config.seed, number))


def missing_trials(out: Path, config: TuneConfig) -> list[int]:
    """The numbers of the trials that are still to be done."""
    abandon(open_study(out, config))
    done = {trial.user_attrs[NUMBER] for trial in done_trials(out, config)}
    return [number for number in range(config.trials) if number not in done]


def done_trials(out: Path, config: TuneConfig) -> list[Any]:
    """The trials that are whole or pruned; of a search that once had more trials than are asked for now, its first."""
    return [trial for trial in finished(open_study(out, config), NUMBER) if trial.user_attrs[NUMBER] < config.trials]


def run_trial(out: Path, config: TuneConfig, controller: ControlConfig, number: int) -> float | None:
    """What a worker does: one trial, 0 being the controller as it is. Returns its cost, None where it was pruned."""
    optuna, study, searched = require_optuna(), open_study(out, config, number), _searched(config, controller)
    if number == 0:
        study.sampler = _as_it_is(study.sampler, controller, searched)
    trial = study.ask()
    trial.set_user_attr(NUMBER, number)
    drawn = {name: trial.suggest_float(name, constant.low, constant.high) for name, constant in searched.items()}
    tried, costs = with_values(controller, _values(drawn, searched)), list[float]()
    for step, maneuver in enumerate(tuned_maneuvers(config)):
        costs.append(cost(drive(maneuver, tried)).total(config.cost))
        mean = sum(costs) / len(costs)
        trial.report(mean, step)
        if is_worse(study, step, mean):
            study.tell(trial, state=optuna.trial.TrialState.PRUNED)
            return None
    study.tell(trial, mean)
    return mean


def _as_it_is(sampler: Any, controller: ControlConfig, searched: Mapping[str, Constant]) -> Any:
    """A sampler that draws a controller's own constants."""
    present = values_of(controller)
    fixed = {name: constant.position_of(present[name]) for name, constant in searched.items()}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # that it is experimental
        return require_optuna().samplers.PartialFixedSampler(fixed, sampler)


def _values(positions: Mapping[str, float], searched: Mapping[str, Constant]) -> dict[str, Any]:
    """The constants for positions on their sliders, whose ends may mean no limit."""
    return {name: searched[name].value_at(round(position, 4)) for name, position in positions.items()}


def is_worse(study: Any, step: int, mean: float) -> bool:
    """Whether a trial is to be pruned: by its mean cost after a step, beside those of all trials that came so far.
    Optuna's MedianPruner takes the least cost of all steps, and so lets pass what fails late."""
    reached = [
        trial.intermediate_values[step] for trial in finished(study, NUMBER) if step in trial.intermediate_values
    ]
    return len(reached) >= STARTUP_TRIALS and mean > float(median(reached))


def _searched(config: TuneConfig, controller: ControlConfig) -> dict[str, Constant]:
    by_name = {constant.name: constant for constant in constants(controller)}
    return {name: by_name[name] for name in config.constants}


def best_controller(out: Path, config: TuneConfig, controller: ControlConfig) -> ControlConfig:
    """That of the cheapest whole trial; the controller itself where none was whole."""
    complete = require_optuna().trial.TrialState.COMPLETE
    whole = [trial for trial in done_trials(out, config) if trial.state == complete]
    if not whole:
        return controller
    best = min(whole, key=lambda trial: (trial.value, trial.user_attrs[NUMBER]))
    return with_values(controller, _values(best.params, _searched(config, controller)))


def _findings(
    out: Path, config: TuneConfig, controller: ControlConfig, workers: int, progress: Progress
) -> TuningResult:
    """Judges the best beside the controller before; what is no better than that is not taken."""
    judges = [controller, best_controller(out, config, controller)]
    before, after = _judged(config, judges, workers, progress)
    if after.tuned.total(config.cost) >= before.tuned.total(config.cost):
        after = before
    trials = done_trials(out, config)
    pruned = sum(trial.state == require_optuna().trial.TrialState.PRUNED for trial in trials)
    return TuningResult(before, after, len(trials), pruned)


def _judged(config: TuneConfig, controllers: Sequence[ControlConfig], workers: int, progress: Progress) -> list[Judged]:
    """Controllers, each driven everywhere."""
    tuned, others = len(tuned_maneuvers(config)), len(other_maneuvers(config))
    jobs = [(k, place) for k in range(len(controllers)) for place in range(tuned + others)]
    costs: dict[tuple[int, int], Cost] = {}
    for done, (job, one) in enumerate(parallel_map(partial(_judge, config, controllers), jobs, workers), 1):
        costs[job] = one
        progress(f"before and after, drive {done} of {len(jobs)}", done / len(jobs))
    return [
        Judged(
            controller, mean_cost([costs[k, place] for place in range(tuned)]),
            mean_cost([costs[k, place] for place in range(tuned, tuned + others)]) if others else None,
        )
        for k, controller in enumerate(controllers)
    ]  # fmt: skip


def _judge(config: TuneConfig, controllers: Sequence[ControlConfig], job: tuple[int, int]) -> Cost:
    """What a worker does: one drive of one controller."""
    which, place = job
    maneuvers = list(chain(tuned_maneuvers(config), other_maneuvers(config)))
    return cost(drive(maneuvers[place], controllers[which]))


def changed_constants(findings: TuningResult) -> dict[str, tuple[Any, Any]]:
    """The constants that differ, before and after."""
    before, after = values_of(findings.before.controller), values_of(findings.after.controller)
    return {name: (before[name], after[name]) for name in before if before[name] != after[name]}
