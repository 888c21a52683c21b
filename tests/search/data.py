"""A tiny recording, a network that learnt on it, and a search of a second."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

from caldrive.perception.training.train import train
from caldrive.search.config import SearchConfig
from caldrive.search.examples import Source
from caldrive.search.studies import TrialJob, run_trial
from tests.perception.data import SHORT, TINY, record

TINY_SEARCH = SearchConfig(
    trials=4, tasks=("hazard_stop", "relative_angle"), steps=5, batch=8, validation_frames=40, best=1, seeds=2,
    joint_steps=4,
)  # fmt: skip


def make_source(folder: Path) -> Source:
    """A recording with held-out episodes, and a network trained on it."""
    data = record(folder / "recording", n_episodes=4, n_frames=90, n_cameras=2)
    model = train(replace(SHORT, steps=2), data, folder / "training", TINY)
    return Source(data, model, folder / "search", validation_share=0.0, seed=0)


@dataclass(frozen=True)
class Work:
    """What a worker does, for processes that know nothing of a test."""

    source: Source
    config: SearchConfig

    def __call__(self, job: TrialJob) -> float | None:
        return run_trial(self.source, self.config, job)
