"""The best blocks of a search, trained again: of many trials the best was lucky, too.

Of each task the best few with history and as many without are trained again with several seeds, so that neither side of
the supplement's comparison has more tries. Their scores are those on all held-out frames, and their mean counts.
"""

from __future__ import annotations

import json
import statistics
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import get_args

from caldrive.affordances import BY_NAME
from caldrive.files import read_json, write_whole
from caldrive.perception.network.config import BlockConfig, Conditioning
from caldrive.search.config import SearchConfig
from caldrive.search.examples import Source
from caldrive.search.learning import measured_training, one_thread, training_seed
from caldrive.search.studies import FinishedTrial, worker_examples

FIRST_SEED = 200_000  # of trainings that are no trials, by their number
RETRAINED = "retrained"  # folder
CONDITIONINGS: tuple[Conditioning, ...] = get_args(Conditioning)


@dataclass(frozen=True)
class RetrainingJob:
    """A block to be trained again: the draw of its trial, and the number of its seed."""

    task: str
    draw: int
    block: BlockConfig
    number: int

    @property
    def name(self) -> str:
        """Of its file."""
        return f"{self.task}-{self.draw}-{self.block.conditioning}-{self.number}.json"


@dataclass(frozen=True)
class Retrained:
    """A block trained with several seeds: its scores on all held-out frames."""

    draw: int
    block: BlockConfig
    values: tuple[float, ...]

    @property
    def mean(self) -> float:
        """Of the scores."""
        return statistics.fmean(self.values)

    @property
    def spread(self) -> float:
        """Standard deviation of the scores; 0 for one."""
        return statistics.stdev(self.values) if len(self.values) > 1 else 0.0


def ranked(task: str, trials: Sequence[FinishedTrial]) -> list[FinishedTrial]:
    """Whole trials by their value, the best first, then pruned ones."""
    sign = -1 if BY_NAME[task].discrete else 1
    return sorted(trials, key=lambda trial: (trial.pruned, sign * trial.value, trial.draw))


def candidates(task: str, trials: Sequence[FinishedTrial], n: int) -> list[FinishedTrial]:
    """The best n trials with history and the best n without, the best first."""
    order = ranked(task, trials)
    kinds = ([trial for trial in order if trial.block.temporal == kind] for kind in (True, False))
    chosen = {trial.draw for of_kind in kinds for trial in of_kind[:n]}
    return [trial for trial in order if trial.draw in chosen]


def retraining_jobs(task: str, trials: Sequence[FinishedTrial], config: SearchConfig) -> list[RetrainingJob]:
    """What is to be trained again of a task."""
    chosen = candidates(task, trials, config.best)
    return [RetrainingJob(task, trial.draw, trial.block, k) for trial in chosen for k in range(config.seeds)]


def conditioning_jobs(task: str, best: Retrained, config: SearchConfig) -> list[RetrainingJob]:
    """The best block of a conditional task with each way to tell it the command."""
    blocks = [replace(best.block, conditioning=kind) for kind in CONDITIONINGS]
    return [RetrainingJob(task, best.draw, block, k) for block in blocks for k in range(config.seeds)]


def retrain(source: Source, config: SearchConfig, job: RetrainingJob) -> float:
    """What a worker does: one training, whose score it writes."""
    examples, seed = worker_examples(source), training_seed(config.seed, FIRST_SEED + job.number)
    once = replace(config, evaluations=1)
    with one_thread():
        [(_, value)] = measured_training(job.task, job.block, examples, examples[1].targets, once, seed)
    content = {"task": job.task, "draw": job.draw, "block": asdict(job.block), "number": job.number, "value": value}
    write_whole(_path(source, job), json.dumps(content).encode())
    return value


def value_of(source: Source, job: RetrainingJob) -> float | None:
    """The score of a training that is done. Raises ValueError where its file is damaged."""
    path = _path(source, job)
    if not path.is_file():
        return None
    try:
        return float(read_json(path.read_bytes(), dict[str, object])["value"])  # type: ignore[arg-type]
    except (ValueError, KeyError, TypeError) as error:
        raise ValueError(f"found that {path} is damaged ({error}), wanted a score: remove it") from error


def retrained(source: Source, jobs: Sequence[RetrainingJob]) -> list[Retrained]:
    """The blocks of jobs that are done, in their order."""
    values: dict[tuple[int, BlockConfig], list[float]] = {}
    for job in jobs:
        if (value := value_of(source, job)) is not None:
            values.setdefault((job.draw, job.block), []).append(value)
    return [Retrained(draw, block, tuple(scores)) for (draw, block), scores in values.items()]


def best_of(task: str, blocks: Sequence[Retrained]) -> Retrained:
    """The best by the mean over the seeds."""
    return (max if BY_NAME[task].discrete else min)(blocks, key=lambda block: block.mean)


def _path(source: Source, job: RetrainingJob) -> Path:
    return source.out / RETRAINED / job.name
