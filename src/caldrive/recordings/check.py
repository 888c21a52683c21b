"""Checks a recording and says what it holds: labels counted and drawn as histograms, after all values and images could
be read."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path
from typing import TypeVar

import numpy as np

from caldrive.affordances import BY_NAME
from caldrive.datatypes import Semantic
from caldrive.files import write_figure
from caldrive.progress import Progress, silent
from caldrive.recordings.folder import Manifest, class_counts, duplicates, episode_paths, joined, read_manifest
from caldrive.recordings.reader import Episode, read_episode
from caldrive.recordings.writer import MANIFEST, EpisodeError

Checked = TypeVar("Checked")

BINS = {  # edges of the histograms' bins, by column
    "vehicle_distance": np.linspace(0, 50, 26),
    "relative_angle": np.linspace(-0.8, 0.8, 41),
    "center_distance": np.linspace(-2, 2, 41),
    "speed": np.linspace(0, 25, 26),
}
UNITS = {"speed": "m/s"} | {name: spec.unit for name, spec in BY_NAME.items()}


@dataclass(frozen=True)
class RecordingSummary:
    """What lies in a folder."""

    episodes: int
    """How many are sound."""
    frames: int
    """How many images they have."""
    minutes: float
    """Simulated time."""
    weathers: dict[str, int]
    """Episodes by weather."""
    counts: dict[str, dict[str, int]]
    """Frames by label and value."""
    damaged: tuple[str, ...]
    """A sentence for each file that is no use, or no use beside the others."""
    missing: int = 0
    """Episodes that were asked for and are not there."""


def check_recording(folder: Path, progress: Progress = silent) -> tuple[RecordingSummary, list[Episode]]:
    """Reads all episodes of a folder; returns what they hold, and those that are sound.

    Raises EpisodeError where there is no episode at all.
    """
    sound, damaged = _check_each(check_episode, episode_paths(folder), progress)
    damaged += duplicates(sound) + _of_another_size(sound)
    folders, unreadable = _check_each(_read_folder, sorted(folder.glob(f"**/{MANIFEST}")))
    damaged += chain.from_iterable(_not_as_declared(*one, sound) for one in folders)
    summary = RecordingSummary(
        episodes=len(sound),
        frames=sum(map(len, sound)),
        minutes=sum(float(np.ptp(episode.columns["time"])) for episode in sound) / 60,
        weathers=dict(Counter(str(episode.scenario.weather) for episode in sound)),
        counts=class_counts(sound) if sound else {},
        damaged=(*damaged, *unreadable),
        missing=sum(_missing(*one) for one in folders),
    )
    return summary, sound


def check_episode(path: Path) -> Episode:
    """An episode whose every image can be decoded, all of one size. Raises EpisodeError where one cannot."""
    episode = read_episode(path, semantic=True)
    size = episode.image(0).shape[:2]
    for row in range(len(episode)):
        if episode.image(row).shape[:2] != size:
            raise EpisodeError(f"row {row} of {path} has an image of another size than row 0: record again")
        if episode.semantics is not None and episode.semantic(row, size).max() >= len(Semantic):
            raise EpisodeError(f"row {row} of {path} has a semantic image with unknown classes: record again")
    return replace(episode, semantics=None)


def _read_folder(manifest: Path) -> tuple[Path, Manifest]:
    """A folder of episodes, and what it says of itself. Raises EpisodeError where nobody can read that."""
    return manifest.parent, read_manifest(manifest)


def _missing(folder: Path, manifest: Manifest) -> int:
    """How many of the episodes that `caldrive collect` was asked for are not in its folder."""
    numbers = (path.stem.removeprefix("episode-") for path in folder.glob("episode-*.parquet"))
    there = sum(number.isdecimal() and int(number) < manifest["episodes"] for number in numbers)
    return manifest["episodes"] - there


def _not_as_declared(folder: Path, manifest: Manifest, episodes: list[Episode]) -> list[str]:
    """A sentence for each episode whose images have another size than its folder says."""
    width, height = manifest["width"], manifest["height"]
    return [
        f"{episode.path} has images of {w} x {h}, its folder says {width} x {height}: remove it and record again"
        for episode in episodes
        for h, w in [episode.image(0).shape[:2]]
        if episode.path.parent == folder and (h, w) != (height, width)
    ]


def _of_another_size(episodes: list[Episode]) -> list[str]:
    """A sentence for each episode whose images are not as large as most are."""
    sizes = [episode.image(0).shape[:2] for episode in episodes]
    (height, width), _ = Counter(sizes).most_common(1)[0] if sizes else ((0, 0), 0)
    return [
        f"{episode.path} has images of {w} x {h}, most have {width} x {height}: keep one size in a folder"
        for episode, (h, w) in zip(episodes, sizes, strict=True)
        if (h, w) != (height, width)
    ]


def _check_each(
    check: Callable[[Path], Checked], paths: list[Path], progress: Progress = silent
) -> tuple[list[Checked], list[str]]:
    """What a check returns for the files that are sound, and a sentence for each of the others."""
    sound, damaged = [], []
    for k, path in enumerate(paths):
        progress("checking", k / len(paths))
        try:
            sound.append(check(path))
        except EpisodeError as error:
            damaged.append(str(error))
    return sound, damaged


def draw_histograms(episodes: list[Episode], counts: dict[str, dict[str, int]], path: Path) -> None:
    """A picture (PNG) of how often each value of each label occurs, all on one logarithmic scale of frames."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(16, 6), layout="constrained")
    axes = figure.subplots(2, 5, sharey=True).ravel()
    for ax, (name, values) in zip(axes, counts.items(), strict=False):
        ax.bar([value.replace(" or ", " or\n") for value in values], list(values.values()), color="#3b6ea5")
        ax.set(title=name.replace("_", " "), yscale="log", ylabel="frames")
    for ax, (name, bins) in zip(axes[len(counts) :], BINS.items(), strict=False):
        ax.hist(joined(episodes, name), bins, color="#c8782d")
        ax.set(title=name.replace("_", " "), yscale="log", xlabel=UNITS[name])
    write_figure(path, figure)
