"""The trials of a search: one Optuna study a task, in a journal that several processes write.

A trial draws a block and trains it. What it draws, and how it learns, depends on the search's seed and the trial's
number only, and for random sampling is the same for all tasks: one set of parameters for all blocks, as in section 3.1.
Which trials are pruned depends on what others have found by then, and so, with several processes, on chance.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal

from caldrive.affordances import BY_NAME
from caldrive.parallel.trials import Draw, abandon, finished, open_journal, require_optuna
from caldrive.perception.network.checkpoint import read_info
from caldrive.perception.network.config import BlockConfig
from caldrive.search.config import SearchConfig
from caldrive.search.examples import Examples, Source, evenly, load_examples
from caldrive.search.learning import evaluation_step, measured_training, one_thread, training_seed
from caldrive.search.space import block_of, suggest_block

STARTUP_TRIALS = 5  # that are whole before any is pruned
FEW = 10  # trials, of which nobody can say what mattered
DRAW = "draw"  # a trial's own number; Optuna's also counts those that were killed


@dataclass(frozen=True)
class TrialJob:
    """A trial to be done."""

    task: str
    draw: int


@dataclass(frozen=True)
class FinishedTrial:
    """A trial that is done."""

    draw: int
    """Its number."""
    block: BlockConfig
    value: float
    """Mean IoU, or scaled MAE; of a pruned one when it was pruned."""
    pruned: bool
    seconds: float
    """It took, in one thread."""


@lru_cache(maxsize=1)
def worker_examples(source: Source) -> tuple[Examples, Examples]:
    """Those that train and those that validate, once for each process."""
    return load_examples(source)


def own_block(source: Source, task: str) -> BlockConfig:
    """The block of a task in the network whose backbone is used."""
    block: BlockConfig = getattr(read_info(source.model).config, task)
    return block


def open_study(out: Path, config: SearchConfig, task: str, draw: int = 0) -> Any:
    """A task's study, made if need be. draw: the trial that it is asked for next. Raises ValueError where the journal
    is damaged."""
    spec, pruner = BY_NAME[task], {"n_startup_trials": STARTUP_TRIALS, "n_warmup_steps": evaluation_step(config, 2)}
    direction: Literal["maximize", "minimize"] = "maximize" if spec.discrete else "minimize"
    return open_journal(out, task, direction, Draw(config.sampler, config.seed, draw), pruner)


def missing_jobs(source: Source, config: SearchConfig) -> list[TrialJob]:
    """The trials that are still to be done, number by number."""
    studies = {task: open_study(source.out, config, task) for task in config.tasks}
    for study in studies.values():
        abandon(study)
    done = {task: {trial.user_attrs[DRAW] for trial in finished(study, DRAW)} for task, study in studies.items()}
    return [TrialJob(task, draw) for draw in range(config.trials) for task in config.tasks if draw not in done[task]]


def finished_trials(source: Source, config: SearchConfig, task: str) -> list[FinishedTrial]:
    """A task's trials, as many as were asked for, by their numbers."""
    like, pruned = own_block(source, task), require_optuna().trial.TrialState.PRUNED
    trials = [
        FinishedTrial(
            draw=trial.user_attrs[DRAW], block=block_of(trial.params, like), value=trial.value,
            pruned=trial.state == pruned, seconds=trial.duration.total_seconds(),
        )
        for trial in finished(open_study(source.out, config, task), DRAW)
    ]  # fmt: skip
    return sorted((trial for trial in trials if trial.draw < config.trials), key=lambda trial: trial.draw)


def importances(source: Source, config: SearchConfig, task: str) -> dict[str, float]:
    """How much each parameter decides whether a trial is among the best of its task (PED-ANOVA), adding up to 1; empty
    where fewer than FEW whole trials would say nothing."""
    optuna = require_optuna()
    study = open_study(source.out, config, task)
    whole = study.get_trials(deepcopy=False, states=(optuna.trial.TrialState.COMPLETE,))
    if len(whole) < FEW:
        return {}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # that it is experimental, and that many trials are alike
        evaluator = optuna.importance.PedAnovaImportanceEvaluator()
        shares: dict[str, float] = optuna.importance.get_param_importances(study, evaluator=evaluator)
    return shares


def run_trial(source: Source, config: SearchConfig, job: TrialJob) -> float | None:
    """What a worker does: one trial, whose value lies in the journal. Returns that, None where it was pruned."""
    study = open_study(source.out, config, job.task, job.draw)
    trial = study.ask()
    trial.set_user_attr(DRAW, job.draw)
    block, value = suggest_block(trial, own_block(source, job.task)), None
    examples = worker_examples(source)
    ids, seed = evenly(examples[1].targets, config.validation_frames), training_seed(config.seed, job.draw)
    with one_thread():
        for step, value in measured_training(job.task, block, examples, ids, config, seed):
            trial.report(value, step)
            if step < config.steps and block.temporal and trial.should_prune():
                study.tell(trial, state=require_optuna().trial.TrialState.PRUNED)
                return None
    study.tell(trial, value)
    return value
