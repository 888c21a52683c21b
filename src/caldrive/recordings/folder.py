"""Folders of recorded episodes: found, counted, and split into those that train and those that validate."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, TypedDict, cast

import msgspec
import numpy as np
from numpy.typing import NDArray

from caldrive.affordances import DISCRETE
from caldrive.datatypes import HAZARD_DISTANCE
from caldrive.files import read_json
from caldrive.recordings.reader import Episode, read_episode
from caldrive.recordings.writer import EpisodeError

Positive = Annotated[int, msgspec.Meta(gt=0)]


class Manifest(TypedDict):
    """What is read of a folder's settings: how many episodes were asked for, and the size of their images in pixels."""

    episodes: Positive
    width: Positive
    height: Positive


def episode_paths(folder: Path | str) -> list[Path]:
    """The files of a folder's episodes by name. Raises EpisodeError where there is none."""
    paths = sorted(Path(folder).glob("**/*.parquet"))
    if not paths and any(Path(folder).glob("**/*.h5")):
        raise EpisodeError(
            f"found HDF5 files in {folder}, which say nothing of affordances, wanted episodes (*.parquet): record some "
            "with `caldrive collect`"
        )
    if not paths:
        raise EpisodeError(f"there is no episode (*.parquet) in {folder}: record some with `caldrive collect`")
    return paths


def read_manifest(path: Path) -> Manifest:
    """What a folder of episodes says of itself, with all other settings. Raises EpisodeError where it is damaged, lacks
    a key or has one of another type."""
    try:
        content = path.read_bytes()
        read_json(content, Manifest)
        return cast(Manifest, read_json(content, dict[str, Any]))
    except (OSError, ValueError) as error:
        raise EpisodeError(
            f"found that {path} is damaged ({error}), wanted a recording's settings: give another folder"
        ) from error


def find_episodes(folder: Path | str, semantic: bool = False, images: bool = True) -> list[Episode]:
    """All episodes of a folder by name; semantic: with their semantic images, where they have them; images: with those
    of the camera.

    Raises EpisodeError where there is none, one is damaged, or one is there twice.
    """
    episodes = [read_episode(path, semantic, images) for path in episode_paths(folder)]
    if sentences := duplicates(episodes):
        raise EpisodeError(sentences[0])
    return episodes


def duplicates(episodes: Sequence[Episode]) -> list[str]:
    """A sentence for each episode that is there again: one that trains must not validate, too."""
    first = {episode.key: episode for episode in reversed(episodes)}
    again = [episode for episode in episodes if first[episode.key] is not episode]
    return [
        f"{episode.path} has id, town, weather and seed of {first[episode.key].path}: keep one, or record with another "
        "--seed"
        for episode in again
    ]


def joined(episodes: Sequence[Episode], name: str) -> NDArray[Any]:
    """A column (N,) of all episodes, one after the other."""
    return np.concatenate([episode.columns[name] for episode in episodes])


def class_counts(episodes: Sequence[Episode]) -> dict[str, dict[str, int]]:
    """How many frames of a recording have each value of the discrete affordances and of the command, turn each way in a
    junction, and have to stop for a person or a car across and not for the car ahead."""
    columns = {name: joined(episodes, name) for name in (*(spec.name for spec in DISCRETE), "command")}
    columns["turn"] = columns["command"][joined(episodes, "junction")]
    near = joined(episodes, "vehicle_distance")[columns["hazard_stop"] > 0] < HAZARD_DISTANCE
    columns["hazard_by"] = np.where(near, "car ahead", "person or car across")
    counts = {}
    for name, column in columns.items():
        values, numbers = np.unique(column, return_counts=True)
        counts[name] = {_text(value): int(n) for value, n in zip(values, numbers, strict=True)}
    return counts


def _text(value: Any) -> str:
    return value if isinstance(value, str) else f"{value:g}"


def split(episodes: Sequence[Episode], share: float, seed: int) -> tuple[list[Episode], list[Episode]]:
    """Training and validation episodes: whole episodes, because neighbouring frames look alike. At least one for each.

    share: of the episodes that validate. Raises EpisodeError for fewer than two episodes.
    """
    if len(episodes) < 2:
        raise EpisodeError(f"found {len(episodes)} episode, training and validation need one each: record more")
    order = np.random.default_rng(seed).permutation(len(episodes))
    n_validation = min(max(1, round(share * len(episodes))), len(episodes) - 1)
    validation = set(order[:n_validation].tolist())
    return (
        [episode for i, episode in enumerate(episodes) if i not in validation],
        [episode for i, episode in enumerate(episodes) if i in validation],
    )


def held_out(episodes: Sequence[Episode], keys: Sequence[str]) -> list[Episode]:
    """The episodes that a network's training kept for validation. keys: theirs, as its checkpoint remembers them.

    Raises EpisodeError where they are not all among these episodes.
    """
    wanted = set(keys)
    kept = [episode for episode in episodes if episode.key in wanted]
    if not wanted or len(kept) != len(wanted):
        raise EpisodeError(
            f"found {len(kept)} of the {len(wanted)} episodes that the network's training kept for validation: give "
            "the folder that it was trained on with --data, or leave --held-out away"
        )
    return kept
