"""Recorded episodes as batches of short windows of consecutive frames.

A window belongs to one camera of one episode: `context` frames of history, then `window` frames that give a loss. A
batch lists each frame once and says where the windows find it, so no frame passes the backbone twice.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from caldrive.datatypes import MAX_VEHICLE_DISTANCE, Command
from caldrive.episode_reader import Episode
from caldrive.episodes import LABELS, EpisodeError
from caldrive.perception.folders import joined
from caldrive.perception.specs import SPECS, encode_columns

Ids = NDArray[np.int64]
COMMAND_NUMBERS = {command.value: number for number, command in enumerate(Command)}
# Edges of the classes in which the size of a continuous column is balanced.
SIZES = {
    "vehicle_distance": (3.0, 6.0, 12.0, 25.0, MAX_VEHICLE_DISTANCE),
    "center_distance": (0.4, 0.8, 1.2),
    "clean_steer": (0.05, 0.15, 0.4),
}
NONE = -1  # number of the command that no frame has
WAITING = 0.25  # weight of a frame in which the car stands and has to: it looks like the one before


@dataclass(frozen=True)
class Batch:
    """images (N, H, W, 3) in bytes, each frame once; semantics (N, H, W), where the recording has them; index (B, T):
    where the windows find their frames among them; group (N,): number of the first window that holds a frame; command
    (B, S); targets: (B * S,) by affordance."""

    images: NDArray[np.uint8]
    semantics: NDArray[np.uint8] | None
    index: Tensor
    group: Tensor
    command: Tensor
    targets: dict[str, Tensor]


class Frames:
    """The frames of some episodes, one after the other: labels, commands, images, the moment of its episode that each
    frame belongs to, and where its stream begins.

    A stream is what one camera saw of one episode without a gap. size: (height, width) of the images; images stay
    decoded in memory where they take at most cache_gb. Images raise EpisodeError where they have another size.
    """

    def __init__(self, episodes: Sequence[Episode], size: tuple[int, int], cache_gb: float = 0.0) -> None:
        self.size = size
        self.episodes = tuple((e.key, len(e)) for e in episodes)
        column = partial(joined, episodes)
        self.labels = {name: column(name) for name in LABELS}
        self.command = np.array([COMMAND_NUMBERS[word] for word in column("command")], dtype=np.int64)
        self.targets = encode_columns(self.labels)
        self.other_command = np.array(
            [COMMAND_NUMBERS.get(word, NONE) for word in column("other_command")], dtype=np.int64
        )
        self.other_targets = {s.name: s.encode(column(f"other_{s.name}")) for s in SPECS if s.conditional}
        self._sizes = [np.digitize(np.abs(column(name)), edges) for name, edges in SIZES.items()]
        self.junction, self.camera_yaw, self.moment = (column(name) for name in ("junction", "camera_yaw", "frame"))
        # Each command asks for one thing inside a junction, for another before it.
        self._manoeuvre = 2 * self.command + self.junction
        self._waiting = (column("speed") < 0.1) & (column("clean_throttle") == 0)
        lengths = [len(e) for e in episodes]
        self.episode = np.repeat(np.arange(len(episodes)), lengths)
        self.stream_start = self._stream_starts(column("camera"))
        self.weather = np.repeat([e.scenario.weather for e in episodes], lengths)
        self.town = np.repeat([e.scenario.town for e in episodes], lengths)
        self._where = [(episode, row) for episode in episodes for row in range(len(episode))]
        self.has_semantics = all(e.semantics is not None for e in episodes)
        self._pool = ThreadPoolExecutor(2)
        self._cache: NDArray[np.uint8] | None = None
        if len(self) * size[0] * size[1] * 3 <= cache_gb * 1e9:
            self._cache = self.images(np.arange(len(self)))

    def __len__(self) -> int:
        return len(self._where)

    @property
    def digest(self) -> str:
        """Tells these episodes and their labels from others."""
        found = hashlib.sha256(repr(self.episodes).encode())
        for values in (self.command, self.other_command, *self.targets.values(), *self.other_targets.values()):
            found.update(np.asarray(values).tobytes())
        return found.hexdigest()[:16]

    def _stream_starts(self, camera: Ids) -> Ids:
        """For each frame the number of its stream's first one."""
        follows = (np.diff(self.episode) == 0) & (np.diff(camera) == 0) & (np.diff(self.moment) == 1)
        first = np.concatenate(([True], ~follows))
        return np.maximum.accumulate(np.where(first, np.arange(len(first)), 0))

    def _decode(self, i: int) -> NDArray[np.uint8]:
        episode, row = self._where[i]
        image = episode.image(row)
        if image.shape[:2] != self.size:
            found, wanted = (f"{w} x {h}" for h, w in (image.shape[:2], self.size))
            raise EpisodeError(f"{episode.path} has images of {found}, the network takes {wanted}: record at that size")
        return image

    def source(self, i: int) -> tuple[Episode, int]:
        """The episode and the row that frame i comes from."""
        return self._where[i]

    def images(self, ids: Ids) -> NDArray[np.uint8]:
        """Images (N, H, W, 3) of frames by number."""
        if self._cache is not None:
            return self._cache[ids]
        images = np.empty((len(ids), *self.size, 3), np.uint8)
        for slot, image in zip(images, self._pool.map(self._decode, ids.tolist()), strict=True):
            slot[:] = image
        return images

    def semantics(self, ids: Ids) -> NDArray[np.uint8] | None:
        """Semantic images (N, H, W) of frames by number, where all episodes have them."""
        if not self.has_semantics:
            return None
        chosen = (self._where[i] for i in ids.tolist())
        return np.stack(list(self._pool.map(lambda where: where[0].semantic(where[1], self.size), chosen)))

    def windows(self, starts: Ids, window: int, context: int) -> Ids:
        """Frames (B, context + window) of the windows whose first frames with a loss are `starts`; before a stream's
        first frame, history is that frame again."""
        ids: Ids = np.maximum(starts[:, None] + np.arange(-context, window), self.stream_start[starts][:, None])
        return ids

    def lessons(self, ids: Ids, other: NDArray[np.bool_] | None = None) -> tuple[Tensor, dict[str, Tensor]]:
        """Commands (B, S) and targets (B * S,) of frames (B, S); other (B,): where another command is given wherever
        that could be."""
        command, targets = self.command[ids], {name: target[ids.ravel()] for name, target in self.targets.items()}
        if other is not None:
            turned = other[:, None] & (self.other_command[ids] != NONE)
            command = np.where(turned, self.other_command[ids], command)
            chosen = torch.from_numpy(turned.ravel())
            for name, target in self.other_targets.items():
                targets[name] = torch.where(chosen, target[ids.ravel()], targets[name])
        return torch.from_numpy(command), targets

    def batch(self, starts: Ids, window: int, context: int, other: NDArray[np.bool_] | None = None) -> Batch:
        """The windows whose first frames with a loss are `starts`; all of them must lie `window` frames before their
        stream's end. other: see `lessons`."""
        ids = self.windows(starts, window, context)
        unique, first, inverse = np.unique(ids, return_index=True, return_inverse=True)
        command, targets = self.lessons(ids[:, context:], other)
        return Batch(
            images=self.images(unique),
            semantics=self.semantics(unique),
            index=torch.from_numpy(inverse.reshape(ids.shape)),
            group=torch.from_numpy(first // ids.shape[1]),
            command=command,
            targets=targets,
        )

    def starts(self, window: int) -> Ids:
        """All frames that begin a window."""
        last = np.arange(len(self)) + window - 1
        inside = last < len(self)
        inside[inside] &= self.stream_start[last[inside]] == self.stream_start[: len(self)][inside]
        return np.flatnonzero(inside)

    def rarity(self, balance: float) -> NDArray[np.float64]:
        """For each frame (N,): (1 / frequency) ** balance of its rarest class; of classes are the discrete affordances,
        the command inside a junction and elsewhere, and the sizes of what is continuous."""
        numbers = [self.targets[s.name].numpy() for s in SPECS if s.discrete] + [self._manoeuvre, *self._sizes]
        frequencies = [(np.bincount(number) / len(self))[number] for number in numbers]
        rarest: NDArray[np.float64] = np.min(frequencies, axis=0)
        return (1 / rarest) ** balance * np.where(self._waiting, WAITING**balance, 1.0)
