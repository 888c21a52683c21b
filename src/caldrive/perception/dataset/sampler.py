"""Which windows of a recording train, and how often each: importance sampling by the rarest label."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from caldrive.affordances import DISCRETE
from caldrive.datatypes import MAX_VEHICLE_DISTANCE
from caldrive.perception.dataset.frames import Frames, Ids
from caldrive.perception.network.checkpoint import DataSummary
from caldrive.recordings.writer import EpisodeError

# Edges of the classes in which the size of a continuous column is balanced.
SIZE_EDGES = {
    "vehicle_distance": (3.0, 6.0, 12.0, 25.0, MAX_VEHICLE_DISTANCE),
    "center_distance": (0.4, 0.8, 1.2),
    "clean_steer": (0.05, 0.15, 0.4),
}
STANDSTILL = 0.1  # m/s, below which a car stands
WAITING_WEIGHT = 0.25  # of a frame in which the car stands and has to: it looks like the one before


def rarity(frames: Frames, balance: float) -> NDArray[np.float64]:
    """For each frame (N,): (1 / frequency) ** balance of its rarest class; of classes are the discrete affordances, the
    command inside a junction and elsewhere, and the sizes of what is continuous."""
    numbers = [frames.targets[spec.name].numpy() for spec in DISCRETE]
    numbers += [np.digitize(np.abs(frames.column(name)), edges) for name, edges in SIZE_EDGES.items()]
    # Each command asks for one thing inside a junction, for another before it.
    numbers.append(2 * frames.command + frames.column("junction"))
    frequencies = [(np.bincount(number) / len(frames))[number] for number in numbers]
    waiting = (frames.column("speed") < STANDSTILL) & (frames.column("clean_throttle") == 0)
    rarest: NDArray[np.float64] = np.min(frequencies, axis=0)
    return (1 / rarest) ** balance * np.where(waiting, WAITING_WEIGHT**balance, 1.0)


def weighted(ids: Ids, cumulative: NDArray[np.float64], chances: NDArray[np.float64]) -> Ids:
    """Of some ids (N,) as many as there are chances (n,) in [0, 1), each as likely as its weight says. cumulative: sums
    of the weights (N,)."""
    drawn: Ids = ids[np.searchsorted(cumulative, chances * cumulative[-1], side="right")]
    return drawn


class Sampler:
    """Draws training windows: the rarer the rarest class or command in it, the likelier a window.

    Hazards, red lights and signs fill a few percent of a drive; drawn evenly, most batches would hold none. What step k
    draws depends on (seed, k) only, so a run can be taken up anywhere. starts: the frames that may begin a window;
    without them all that do.
    """

    def __init__(self, frames: Frames, window: int, balance: float, seed: int, starts: Ids | None = None) -> None:
        self.frames, self.window, self.seed = frames, window, seed
        self.starts = frames.window_starts(window) if starts is None else starts
        if not len(self.starts):
            raise EpisodeError(
                f"found no stream of frames that is {window} long, wanted one: record longer episodes, or type a "
                "smaller --window"
            )
        weights = rarity(frames, balance)
        weight = np.max([weights[self.starts + i] for i in range(window)], axis=0)
        self.probability = weight / weight.sum()
        self._cumulative = np.cumsum(self.probability)

    def draw(self, step: int, n: int) -> Ids:
        """First frames of n windows."""
        return weighted(self.starts, self._cumulative, np.random.default_rng((self.seed, step)).random(n))

    def alternatives(self, step: int, n: int, share: float) -> NDArray[np.bool_]:
        """Which of n windows, a share of them, are seen under the alternative command, if one could be given."""
        return np.random.default_rng((self.seed, step, 1)).random(n) < share

    def class_counts(self) -> dict[str, NDArray[np.float64]]:
        """How many samples of each class the drawn windows hold, by affordance, in expectation and scaled to the data's
        size."""
        share = np.zeros(len(self.frames))
        for i in range(self.window):
            share[self.starts + i] += self.probability / self.window  # each frame once
        samples = share * len(self.frames)
        return {
            spec.name: np.bincount(self.frames.targets[spec.name].numpy(), samples, spec.outputs).astype(float)
            for spec in DISCRETE
        }


def data_summary(train: Frames, validation: Frames) -> DataSummary:
    """What a checkpoint says of its data."""
    return {
        "train_frames": len(train),
        "validation_frames": len(validation),
        "train_classes": {
            spec.name: np.bincount(train.targets[spec.name], minlength=spec.outputs).tolist() for spec in DISCRETE
        },
        "validation_episodes": sorted({episode.key for episode in validation.episodes}),
    }
