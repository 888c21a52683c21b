"""Recorded episodes as batches of short windows of consecutive frames.

A window belongs to one camera of one episode: `context` frames of history, then `window` frames that give a loss. A
batch lists each frame once and says where the windows find it, so no frame passes the backbone twice.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from caldrive.affordances import CONDITIONAL, SPECS
from caldrive.perception.network.network import COMMANDS
from caldrive.perception.targets import encode
from caldrive.recordings.folder import joined
from caldrive.recordings.reader import Episode
from caldrive.recordings.writer import EpisodeError

Ids = NDArray[np.int64]  # numbers of frames
COMMAND_NUMBERS = {command.value: number for number, command in enumerate(COMMANDS)}
NO_COMMAND = -1


def _command_numbers(commands: NDArray[Any]) -> Ids:
    """Commands (N,) as the network counts them; NO_COMMAND where there is none."""
    return np.array([COMMAND_NUMBERS.get(command, NO_COMMAND) for command in commands], dtype=np.int64)


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
    """The frames of some episodes, one after the other: labels, commands, images, the time step of its episode that
    each frame belongs to, and where its stream begins.

    A stream is what one camera saw of one episode without a gap. size: (height, width) of the images; images stay
    decoded in memory where they take at most cache_gb. Images raise EpisodeError where they have another size.
    """

    def __init__(self, episodes: Sequence[Episode], size: tuple[int, int], cache_gb: float = 0.0) -> None:
        self.size, self.episodes = size, tuple(episodes)
        self.targets = {spec.name: encode(spec, self.column(spec.name)) for spec in SPECS}
        self.command = _command_numbers(self.column("command"))
        self.alternative_command = _command_numbers(self.column("other_command"))
        self.alternative_targets = {s.name: encode(s, self.column(f"other_{s.name}")) for s in CONDITIONAL}
        self.episode, self.time_step = self.by_episode(range(len(episodes))), self.column("frame")
        self.stream_start = self._stream_starts()
        self._first_row = np.concatenate(([0], np.cumsum([len(episode) for episode in episodes])))  # of each episode
        self.has_semantics = all(episode.semantics is not None for episode in episodes)
        self._pool = ThreadPoolExecutor(2)
        self._cache: NDArray[np.uint8] | None = None
        if len(self) * size[0] * size[1] * 3 <= cache_gb * 1e9:
            self._cache = self.images(np.arange(len(self)))

    def __len__(self) -> int:
        return len(self.episode)

    @cached_property
    def digest(self) -> str:
        """Tells these episodes, their labels and images from others; other images have JPEGs of other lengths."""
        digest = hashlib.sha256(repr([(episode.key, len(episode)) for episode in self.episodes]).encode())
        for episode in self.episodes:
            for blobs in (episode.jpegs, episode.semantics or ()):
                digest.update(np.array([len(blob) for blob in blobs]).tobytes())
        targets = (*self.targets.values(), *self.alternative_targets.values())
        for values in (self.command, self.alternative_command, *targets):
            digest.update(np.asarray(values).tobytes())
        return digest.hexdigest()[:16]

    def column(self, name: str) -> NDArray[Any]:
        """A column (N,) of the recording."""
        return joined(self.episodes, name)

    def by_episode(self, values: Iterable[Any]) -> NDArray[Any]:
        """For each frame (N,) what its episode has of these, one for each episode."""
        return np.repeat(list(values), [len(episode) for episode in self.episodes])

    def _stream_starts(self) -> Ids:
        """For each frame the number of its stream's first one."""
        camera = self.column("camera")
        follows = (np.diff(self.episode) == 0) & (np.diff(camera) == 0) & (np.diff(self.time_step) == 1)
        first = np.concatenate(([True], ~follows))
        return np.maximum.accumulate(np.where(first, np.arange(len(first)), 0))

    def source(self, i: int) -> tuple[Episode, int]:
        """The episode and the row that frame i comes from."""
        number = self.episode[i]
        return self.episodes[number], int(i - self._first_row[number])

    def images(self, ids: Ids) -> NDArray[np.uint8]:
        """Images (N, H, W, 3) of frames by number."""
        if self._cache is not None:
            return self._cache[ids]
        images = np.empty((len(ids), *self.size, 3), np.uint8)
        for slot, image in zip(images, self._pool.map(self._decode, ids.tolist()), strict=True):
            slot[:] = image
        return images

    def _decode(self, i: int) -> NDArray[np.uint8]:
        episode, row = self.source(i)
        image = episode.image(row)
        if image.shape[:2] != self.size:
            recorded, wanted = (f"{w} x {h}" for h, w in (image.shape[:2], self.size))
            raise EpisodeError(
                f"found images of {recorded} in {episode.path}, wanted {wanted} for the network: record at that size"
            )
        return image

    def semantics(self, ids: Ids) -> NDArray[np.uint8] | None:
        """Semantic images (N, H, W) of frames by number, where all episodes have them."""
        if not self.has_semantics:
            return None
        sources = map(self.source, ids.tolist())
        return np.stack(list(self._pool.map(lambda source: source[0].semantic(source[1], self.size), sources)))

    def window_starts(self, window: int) -> Ids:
        """All frames that begin a window."""
        starts = np.arange(len(self) - window + 1)
        within: Ids = starts[self.stream_start[starts] == self.stream_start[starts + window - 1]]
        return within

    def windows(self, starts: Ids, window: int, context: int) -> Ids:
        """Frames (B, context + window) of the windows whose first frames with a loss are `starts`; before a stream's
        first frame, history is that frame again."""
        ids: Ids = np.maximum(starts[:, None] + np.arange(-context, window), self.stream_start[starts][:, None])
        return ids

    def commands_and_targets(
        self, ids: Ids, alternative: NDArray[np.bool_] | None = None
    ) -> tuple[Tensor, dict[str, Tensor]]:
        """Commands (B, S) and targets (B * S,) of frames (B, S).

        alternative (B,): windows that are seen under the alternative command, wherever one could be given.
        """
        command, targets = self.command[ids], {name: target[ids.ravel()] for name, target in self.targets.items()}
        if alternative is not None:
            exchanged = alternative[:, None] & (self.alternative_command[ids] != NO_COMMAND)
            command = np.where(exchanged, self.alternative_command[ids], command)
            mask = torch.from_numpy(exchanged.ravel())
            for name, target in self.alternative_targets.items():
                targets[name] = torch.where(mask, target[ids.ravel()], targets[name])
        return torch.from_numpy(command), targets

    def batch(self, starts: Ids, window: int, context: int, alternative: NDArray[np.bool_] | None = None) -> Batch:
        """The windows whose first frames with a loss are `starts`; all of them must lie `window` frames before their
        stream's end. alternative: as in `commands_and_targets`."""
        ids = self.windows(starts, window, context)
        unique, first, inverse = np.unique(ids, return_index=True, return_inverse=True)
        command, targets = self.commands_and_targets(ids[:, context:], alternative)
        return Batch(
            images=self.images(unique),
            semantics=self.semantics(unique),
            index=torch.from_numpy(inverse.reshape(ids.shape)),
            group=torch.from_numpy(first // ids.shape[1]),
            command=command,
            targets=targets,
        )
