"""Which windows of a recording train, and how often each."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from caldrive.episodes import EpisodeError
from caldrive.perception.dataset import Frames, Ids
from caldrive.perception.specs import SPECS

OTHERS = 0.5  # share of the windows that are seen with another command, if one could be given


class Sampler:
    """Draws training windows: the rarer the rarest class or command in it, the likelier a window.

    Hazards, red lights and signs fill a few percent of a drive; drawn evenly, most batches would hold none. What step k
    draws depends on (seed, k) only, so a run can be taken up anywhere.
    """

    def __init__(self, frames: Frames, window: int, balance: float, seed: int) -> None:
        self.frames, self.window, self.seed = frames, window, seed
        self.starts = frames.starts(window)
        if not len(self.starts):
            raise EpisodeError(
                f"no stream of frames is {window} long: record longer episodes or make the window shorter"
            )
        rarity = frames.rarity(balance)
        weight = np.max([rarity[self.starts + i] for i in range(window)], axis=0)
        self.probability = weight / weight.sum()
        self._cumulative = np.cumsum(self.probability)

    def draw(self, step: int, n: int) -> Ids:
        """First frames of n windows."""
        chance = np.random.default_rng((self.seed, step)).random(n) * self._cumulative[-1]
        chosen: Ids = self.starts[np.searchsorted(self._cumulative, chance, side="right")]
        return chosen

    def others(self, step: int, n: int) -> NDArray[np.bool_]:
        """Which of n windows are seen with another command, if one could be given."""
        return np.random.default_rng((self.seed, step, 1)).random(n) < OTHERS

    def class_counts(self) -> dict[str, NDArray[np.float64]]:
        """How many samples of each class the drawn windows hold, by affordance, in expectation and scaled to the data's
        size."""
        share = np.zeros(len(self.frames))
        for i in range(self.window):
            np.add.at(share, self.starts + i, self.probability / self.window)
        return {
            s.name: np.bincount(self.frames.targets[s.name].numpy(), share * len(self.frames), s.outputs).astype(float)
            for s in SPECS
            if s.discrete
        }


def summary(train: Frames, held: Frames) -> dict[str, Any]:
    """What a checkpoint remembers of its data. validation_episodes: keys of those kept for validation."""
    counts = {s.name: np.bincount(train.targets[s.name], minlength=s.outputs).tolist() for s in SPECS if s.discrete}
    return {
        "train_frames": len(train),
        "validation_frames": len(held),
        "train_classes": counts,
        "validation_episodes": sorted({held.source(i)[0].key for i in range(len(held))}),
    }
