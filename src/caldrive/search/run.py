"""A search from a recording and a network to a better one and a report; killed anywhere, the same call goes on."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import chain
from typing import TypeVar

from caldrive.affordances import BY_NAME, CONDITIONAL
from caldrive.checks import MOST_WORKERS, require_within, require_writable_folder
from caldrive.files import claim_folder, locked_folder
from caldrive.parallel.processes import parallel_map
from caldrive.parallel.ray_cluster import cluster_map, require_ray
from caldrive.parallel.trials import mend_journal, require_optuna
from caldrive.perception.network.checkpoint import load_network
from caldrive.perception.network.config import BlockConfig, Conditioning
from caldrive.progress import Progress, silent
from caldrive.search.best import (
    CONDITIONINGS,
    Retrained,
    RetrainingJob,
    best_of,
    conditioning_jobs,
    retrain,
    retrained,
    retraining_jobs,
    value_of,
)
from caldrive.search.config import SearchConfig
from caldrive.search.examples import Source, checked_parts, make_features
from caldrive.search.joint import JointNetwork, network_scores, train_joint
from caldrive.search.studies import FinishedTrial, finished_trials, missing_jobs, run_trial, worker_examples

SETTINGS, MODEL = "search.json", "model.safetensors"
Item = TypeVar("Item")
Result = TypeVar("Result")


@dataclass(frozen=True)
class Workers:
    """Who works: so many processes here, or Ray at an address."""

    processes: int = 1
    ray: str | None = None

    def map(self, work: Callable[[Item], Result], items: Sequence[Item]) -> Iterator[tuple[Item, Result]]:
        """The items with their results as they are done."""
        if self.ray is None:
            return parallel_map(work, items, self.processes)
        return cluster_map(work, items, self.processes, self.ray)


@dataclass(frozen=True)
class TaskResult:
    """What a search found for a task."""

    task: str
    trials: tuple[FinishedTrial, ...]
    """By their numbers."""
    retrained: tuple[Retrained, ...]
    """The best, with several seeds, in the order of their trials' values."""
    conditioned: tuple[Retrained, ...]
    """The best with each way to tell it the command, where that was asked for."""

    @property
    def best(self) -> Retrained:
        """Of those that were trained again."""
        return best_of(self.task, self.retrained)

    def best_of_kind(self, *, temporal: bool) -> Retrained | None:
        """The best with history, or without; None where no trial was of that kind."""
        blocks = [block for block in self.retrained if block.block.temporal == temporal]
        return best_of(self.task, blocks) if blocks else None


@dataclass(frozen=True)
class SearchResult:
    """What a search found."""

    tasks: tuple[TaskResult, ...]
    before: Mapping[str, float]
    """The scores by task of the network that the backbone comes from."""
    networks: Mapping[Conditioning, JointNetwork]
    """That of the best blocks (groups), and the same with other ways to tell the command, where that was asked for."""
    frames: tuple[int, int]
    """That blocks learn from and are compared on."""
    episodes: tuple[int, int]
    """That train and that are held out."""


def search(config: SearchConfig, source: Source, workers: Workers, progress: Progress = silent) -> SearchResult:
    """Does what a search's folder lacks: trials, the best of each task again, and the network of the best.

    In the folder lie journal.log (Optuna's), features, retrained, and model.safetensors. Raises ValueError where the
    data, the network or what lies in the folder does not go together, RuntimeError without Optuna.
    """
    require_optuna()
    if workers.ray is not None:
        require_ray()
    require_within("--workers", workers.processes, 1, MOST_WORKERS, 2)
    require_writable_folder(source.out)
    with locked_folder(source.out):
        try:
            parts = checked_parts(source, config)
            about = config.decisive() | {"features": [part.digest for part in parts]}
            claim_folder(source.out / SETTINGS, about, "a search")
            make_features(source, parts, progress)
            mend_journal(source.out)
            _run_trials(config, source, workers, progress)
            return _findings(config, source, workers, progress)
        finally:
            worker_examples.cache_clear()


def _run_trials(config: SearchConfig, source: Source, workers: Workers, progress: Progress) -> None:
    """The trials that are missing."""
    jobs, total = missing_jobs(source, config), config.trials * len(config.tasks)
    for done, (job, _) in enumerate(workers.map(partial(run_trial, source, config), jobs), total - len(jobs) + 1):
        progress(f"trial {done} of {total}, {BY_NAME[job.task].title}", done / total)


def _findings(config: SearchConfig, source: Source, workers: Workers, progress: Progress) -> SearchResult:
    """Trains the best again, then their network."""
    tasks: tuple[str, ...] = config.tasks
    trials = {task: finished_trials(source, config, task) for task in tasks}
    jobs = {task: retraining_jobs(task, trials[task], config) for task in tasks}
    again = _retrain(jobs, config, source, workers, progress)
    best = {task: best_of(task, blocks) for task, blocks in again.items()}
    conditional = [spec.name for spec in CONDITIONAL if spec.name in best] if config.conditioning else []
    jobs = {task: conditioning_jobs(task, best[task], config) for task in conditional}
    conditioned = _retrain(jobs, config, source, workers, progress)
    networks = {
        kind: train_joint(source, config, blocks, source.out / _file(kind), progress)
        for kind, blocks in _networks(best, conditional)
    }
    training, validation = worker_examples(source)
    return SearchResult(
        tasks=tuple(
            TaskResult(task, tuple(trials[task]), tuple(again[task]), tuple(conditioned.get(task, ())))
            for task in tasks
        ),
        before=network_scores(load_network(source.model)[0], validation),
        networks=networks,
        frames=(len(training.targets), len(validation.targets)),
        episodes=(len(training.frames.episodes), len(validation.frames.episodes)),
    )


def _retrain(
    jobs: Mapping[str, list[RetrainingJob]], config: SearchConfig, source: Source, workers: Workers, progress: Progress
) -> dict[str, list[Retrained]]:
    """Does the trainings of the best blocks that are missing; returns all of them by task."""
    everything = list(chain(*jobs.values()))
    missing = [job for job in everything if value_of(source, job) is None]
    work, total = partial(retrain, source, config), len(everything)
    for done, (job, _) in enumerate(workers.map(work, missing), total - len(missing) + 1):
        progress(f"the best again, {done} of {total}, {BY_NAME[job.task].title}", done / total)
    return {task: retrained(source, of_task) for task, of_task in jobs.items()}


def _file(kind: Conditioning) -> str:
    """The name of a network's file."""
    return MODEL if kind == CONDITIONINGS[0] else f"conditioning-{kind}.safetensors"


def _networks(
    best: Mapping[str, Retrained], conditional: Sequence[str]
) -> Iterator[tuple[Conditioning, dict[str, BlockConfig]]]:
    """The blocks of the best network, by its way to tell them the command."""
    blocks = {task: found.block for task, found in best.items()}
    for kind in CONDITIONINGS if conditional else CONDITIONINGS[:1]:
        yield kind, blocks | {task: replace(blocks[task], conditioning=kind) for task in conditional}
