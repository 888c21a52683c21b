"""Frames of a recording in which an affordance matters: a red light, somebody in the way, a sign, a car ahead, a
turn."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from caldrive.datatypes import Command, Image, Semantic
from caldrive.explain.activation_maps import Question
from caldrive.recordings.folder import episode_paths
from caldrive.recordings.reader import Episode, read_episode
from caldrive.recordings.writer import EpisodeError

Rows = NDArray[np.bool_]
NEAR_CAR = 20.0  # m
BEND = 0.15  # rad, from which a way is no longer straight
FEWEST_SHOWN = 20  # that a thing takes in the image, to be seen at all
MIDDLE = 1  # the number of the camera in the car's middle


@dataclass(frozen=True)
class Situation:
    """A kind of frame."""

    name: str
    affordance: str
    """What matters in it."""
    rows: Callable[[Episode], Rows]
    """Which rows of an episode are of this kind, by its labels."""
    shows: tuple[Semantic, ...] = ()
    """What has to be seen in it, more of the first of them than of the others."""


def _column(name: str, test: Callable[[NDArray[np.float64]], Rows]) -> Callable[[Episode], Rows]:
    return lambda episode: test(episode.columns[name])


def _turn(episode: Episode) -> Rows:
    turns = episode.columns["command"] != Command.STRAIGHT.value
    result: Rows = turns & episode.columns["junction"] & (np.abs(episode.columns["relative_angle"]) > BEND)
    return result


def _straight(episode: Episode) -> Rows:
    result: Rows = (np.abs(episode.columns["relative_angle"]) < BEND) & ~episode.columns["junction"]
    return result


SITUATIONS = (
    Situation("red light", "red_light", _column("red_light", lambda x: x > 0), (Semantic.LIGHT,)),
    Situation(
        "hazard by a person", "hazard_stop", _column("hazard_stop", lambda x: x > 0),
        (Semantic.PERSON, Semantic.VEHICLE),
    ),
    Situation(
        "hazard by a car", "hazard_stop", _column("hazard_stop", lambda x: x > 0), (Semantic.VEHICLE, Semantic.PERSON)
    ),
    Situation("speed sign", "speed_sign", _column("speed_sign", lambda x: x > 0), (Semantic.SIGN,)),
    Situation(
        "car ahead", "vehicle_distance", _column("vehicle_distance", lambda x: x < NEAR_CAR), (Semantic.VEHICLE,)
    ),
    Situation("turn", "relative_angle", _turn),
    Situation("straight", "center_distance", _straight),
)  # fmt: skip


@dataclass(frozen=True)
class Example:
    """A frame of a recording, with what came before it."""

    situation: Situation
    images: tuple[Image, ...]
    """(H, W, 3), the oldest first, the frame itself last."""
    semantics: NDArray[np.uint8] | None
    """Its semantic image (H, W), where it was recorded."""
    command: Command
    truth: float
    """The label of the affordance that matters, 0 for no sign."""
    source: str
    """Its episode and row."""

    @property
    def question(self) -> Question:
        """What to ask a network about it."""
        return Question(self.situation.affordance, self.command)


def find_examples(
    folder: Path, n: int, history: int, seed: int, keys: Sequence[str] | None = None
) -> dict[str, list[Example]]:
    """Up to n frames of each situation, no two of one episode, by its name. history: frames before each.

    keys: of the episodes to look in, None for all. Raises EpisodeError where none of them is in the folder, or nothing
    in them.
    """
    rng = np.random.default_rng(seed)
    paths = [path for path in episode_paths(folder) if keys is None or read_episode(path, images=False).key in keys]
    if not paths:
        raise EpisodeError(
            f"found none of the episodes in {folder} that the network's training kept for validation: give the folder "
            "that it was trained on, or leave --held-out out"
        )
    found: dict[str, list[Example]] = {situation.name: [] for situation in SITUATIONS}
    for index in rng.permutation(len(paths)):
        if all(len(examples) == n for examples in found.values()):
            break
        episode = read_episode(paths[index], semantic=True)
        for example in _examples(episode, history, rng):
            if len(found[example.situation.name]) < n:
                found[example.situation.name].append(example)
    if not any(found.values()):
        raise EpisodeError(
            f"found no situation in {folder} with {history} frames before it, wanted one: record longer episodes"
        )
    return found


def _examples(episode: Episode, history: int, rng: np.random.Generator) -> Iterator[Example]:
    """At most one frame of each situation, with all of its history in the episode."""
    columns = episode.columns
    steps, middle = columns["frame"], columns["camera"] == MIDDLE
    for situation in SITUATIONS:
        rows = np.flatnonzero(situation.rows(episode) & middle)
        whole = [i for i in rows if i >= history and middle[i - history] and steps[i] - steps[i - history] == history]
        for i in rng.permutation(np.array(whole, int))[:3]:
            semantics = episode.semantic(i) if episode.semantics is not None else None
            if semantics is None or _shows(semantics, situation.shows):
                images = tuple(episode.image(j) for j in range(i - history, i + 1))
                command, truth = Command(columns["command"][i]), float(columns[situation.affordance][i])
                yield Example(situation, images, semantics, command, truth, f"{episode.path.stem}, row {i}")
                break


def _shows(semantics: NDArray[np.uint8], wanted: tuple[Semantic, ...]) -> bool:
    """Whether enough of the first class is seen, and more than of the others."""
    counts = [int((semantics == one).sum()) for one in wanted]
    return not counts or (counts[0] >= FEWEST_SHOWN and counts[0] == max(counts))
