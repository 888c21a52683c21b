"""What a search learns from: frames without their images, and what a finished backbone makes of them.

The features are made once, with progress, and then lie in one file, which all processes read from the same memory.
"""

from __future__ import annotations

import hashlib
import shutil
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
import torch
from safetensors import safe_open
from torch import Tensor

from caldrive.affordances import BY_NAME
from caldrive.perception.dataset.frames import Frames, Ids
from caldrive.perception.inference.precision import driving_precision
from caldrive.perception.network.checkpoint import load_network, read_info
from caldrive.perception.network.config import BlockConfig
from caldrive.perception.network.tensor_file import CheckpointError, read_header, write_tensors
from caldrive.perception.training.history_stage import feature_table
from caldrive.progress import Progress
from caldrive.provenance import file_digest
from caldrive.recordings.folder import find_episodes, held_out, split
from caldrive.recordings.reader import Episode, read_episode
from caldrive.recordings.writer import EpisodeError
from caldrive.scenarios import require_to_learn_from
from caldrive.search.config import SearchConfig
from caldrive.search.space import LONGEST_SPAN

HISTORY = LONGEST_SPAN + 2  # frames at an episode's beginning that are history only, for all blocks
PARTS = ("training", "validation")


@dataclass(frozen=True)
class Source:
    """Where examples come from: a folder of episodes, a network's file, the search's folder, the share of the episodes
    that is held out (0: those that the network's training held out), and the seed of that."""

    data: Path
    model: Path
    out: Path
    validation_share: float
    seed: int


@dataclass(frozen=True)
class Examples:
    """Frames without images, and their features (N, F) in 16 bits."""

    frames: Frames
    features: Tensor

    @cached_property
    def targets(self) -> Ids:
        """The frames that blocks are compared on: the same for all, however far they look back."""
        return target_frames(self.frames)

    def sequences(self, ids: Ids, block: BlockConfig) -> Tensor:
        """What a block sees at frames (N,): features (N, length, F)."""
        seen = self.frames.windows(ids, window=1, context=block.span - 1)[:, :: block.dilation]
        return self.features[torch.from_numpy(seen)].float()


def target_frames(frames: Frames) -> Ids:
    """The frames that have enough of an episode before them for every block."""
    return np.flatnonzero(frames.time_step >= HISTORY)


def evenly(ids: Ids, n: int) -> Ids:
    """At most n of some frames (N,), as far apart as can be."""
    return ids[np.linspace(0, max(0, len(ids) - 1), min(n, len(ids))).astype(np.int64)]


def split_episodes(source: Source, *, images: bool) -> tuple[list[Episode], list[Episode]]:
    """The episodes that train, and those that validate. Raises ValueError for a town that may only judge, and where the
    folder does not have the episodes that the network's training held out."""
    episodes = find_episodes(source.data, images=images)
    for town in {episode.scenario.town for episode in episodes}:
        require_to_learn_from(town)
    if source.validation_share:
        return split(episodes, source.validation_share, source.seed)
    keys = read_info(source.model).data.get("validation_episodes", [])
    validation = _held_out(episodes, keys, source)
    return [episode for episode in episodes if episode.key not in set(keys)], validation


def _held_out(episodes: Sequence[Episode], keys: Sequence[str], source: Source) -> list[Episode]:
    try:
        validation = held_out(episodes, keys)
    except EpisodeError as error:
        raise EpisodeError(
            f"found not all of the {len(keys)} episodes in {source.data} that the training of {source.model} held out, "
            "wanted them, to compare blocks on what it has not seen: give the --data that it was trained on, or, for a "
            "recording that it has not learnt from, type --validation-share 0.1"
        ) from error
    if len(validation) == len(episodes):
        raise EpisodeError(f"found only held-out episodes in {source.data}, wanted some to learn from: record more")
    return validation


@dataclass(frozen=True)
class Part:
    """The frames that train, or those that validate, before there are features of them. digest: tells these from
    others."""

    path: Path
    frames: Frames
    digest: str


def checked_parts(source: Source, config: SearchConfig) -> list[Part]:
    """Frames that train and frames that validate. Raises EpisodeError where an affordance that is sought never changes,
    CheckpointError where the network does not fit this code."""
    size, parts = read_info(source.model).config.image_size, []
    for part, episodes in zip(PARTS, split_episodes(source, images=False), strict=True):
        frames = Frames(episodes, size)
        n = config.validation_frames if part == PARTS[1] else len(frames)
        _require_targets(frames, n, config.tasks, f"{part} in {source.data}")
        parts.append(Part(_path(source, part), frames, _digest(source, frames)))
    return parts


def make_features(source: Source, parts: Sequence[Part], progress: Progress) -> None:
    """Writes the features of all frames, unless they are there; goes on after a kill. Raises EpisodeError where images
    do not fit the network."""
    network, info = load_network(source.model)
    for part in parts:
        chunks = part.path.with_suffix("")
        if not _is_there(part.path, part.digest):
            seen = Frames([read_episode(episode.path) for episode in part.frames.episodes], network.config.image_size)
            table = feature_table(network, seen, info.ranges, chunks, progress)
            write_tensors(part.path, {"features": table}, {"kind": "features", "digest": part.digest})
        shutil.rmtree(chunks, ignore_errors=True)  # also after a kill right before this


def _require_targets(frames: Frames, n: int, tasks: Sequence[str], place: str) -> None:
    """Raises EpisodeError where n frames of those that blocks are compared on show nothing. place: where they are."""
    targets = evenly(target_frames(frames), n)
    if not len(targets):
        raise EpisodeError(
            f"found no frame of {place} behind the first {HISTORY} of its episode, wanted some: record longer episodes"
        )
    for spec in map(BY_NAME.__getitem__, tasks):
        if spec.discrete and len(np.unique(frames.targets[spec.name].numpy()[targets])) < 2:
            raise EpisodeError(
                f"found one value only of the {spec.title} among {len(targets)} frames of {place}, wanted several: "
                "record more episodes, or leave it out of --tasks"
            )


def load_examples(source: Source) -> tuple[Examples, Examples]:
    """Those that train and those that validate, once `make_features` was there. The features are mapped into
    memory, so that processes share them."""
    size = read_info(source.model).config.image_size
    examples = []
    for part, episodes in zip(PARTS, split_episodes(source, images=False), strict=True):
        with safe_open(_path(source, part), "pt") as file:
            examples.append(Examples(Frames(episodes, size), file.get_tensor("features")))
    training, validation = examples
    return training, validation


def features_digest(source: Source) -> list[str]:
    """Tells the examples from others."""
    return [read_header(_path(source, part))["digest"] for part in PARTS]


def _path(source: Source, part: str) -> Path:
    return source.out / "features" / f"{part}.safetensors"


def _is_there(path: Path, digest: str) -> bool:
    try:
        return bool(read_header(path).get("digest") == digest)
    except CheckpointError:
        return False


def _digest(source: Source, frames: Frames) -> str:
    """Of all that features depend on. That images changed and labels did not shows in the size of the files."""
    precision = driving_precision("auto", read_info(source.model).ranges)
    sizes = [episode.path.stat().st_size for episode in frames.episodes]
    values = repr((file_digest(source.model), precision, frames.digest, sizes))
    return hashlib.sha256(values.encode()).hexdigest()[:16]
