"""One recorded episode: oracle and controller drive from somewhere in a town, three cameras look on (section 3.1).

Not every moment of a drive becomes a key frame: a car that stands tells the same until what it should stop for changes,
and one that follows no other tells little to those who are to learn distances.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from caldrive.collection.config import CollectConfig
from caldrive.collection.perturbation import Disturbance, LateStart
from caldrive.collection.start_poses import SEARCH, begin_episode, plan_episode
from caldrive.datatypes import Affordances, CameraConfig, Control, Observation
from caldrive.interfaces import RecordableWorld
from caldrive.recordings.writer import EpisodeWriter, Frame, episode_path

PATIENCE = 2  # times the wanted duration that a drive may last
BEGINNING = 6  # a tailgater's first moments are key frames, one in so many of those wanted, and later it takes a car
MEETING = 25.0  # m; a car ahead that is nearer
STANDING = 0.1  # m/s
STOOD = 15  # moments that are key frames when the car comes to stand,
RUN, EVERY = 9, 135  # and then a run of so many in so many: single ones would have no history
BASELINES = (-0.5, 0.0, 0.5)  # m, + left (section 3.1)
MAX_YAW = math.radians(15)


class KeyFrames:
    """Says which moments of a drive are key frames, and when there are enough. wanted: how many.

    A car that stands tells the same until what it should stop for changes. A tailgater tells at first, for the empty
    street, and then where a car is near.
    """

    def __init__(self, wanted: int, tailgating: bool) -> None:
        self.wanted, self.tailgating = wanted, tailgating
        self.most = (SEARCH if tailgating else PATIENCE) * wanted  # moments that the drive may last
        self.taken, self._index, self._stood, self._before = 0, 0, 0, (0.0, 0.0)

    def takes(self, labels: Affordances, speed: float) -> bool:
        """Whether the next moment is a key frame."""
        reasons = labels.hazard_stop, labels.red_light
        self._stood = self._stood + 1 if speed < STANDING and reasons == self._before else 0
        self._before = reasons
        telling = self._stood <= STOOD or self._stood % EVERY < RUN
        if self.tailgating:
            beginning = self._index < max(1, self.wanted // BEGINNING)
            telling = telling and (beginning or labels.vehicle_distance < MEETING)
        self._index += 1
        self.taken += telling
        return telling


def _mounts(config: CollectConfig, rng: np.random.Generator) -> list[CameraConfig]:
    """Three cameras, each turned by chance."""
    yaws = rng.uniform(-MAX_YAW, MAX_YAW, size=len(BASELINES))
    size = config.width, config.height
    return [CameraConfig(*size, left=left, yaw=float(yaw)) for left, yaw in zip(BASELINES, yaws, strict=True)]


def record_episode(world: RecordableWorld, config: CollectConfig, number: int, folder: Path) -> int:
    """Drives and records one episode; returns its number of frames (key frames times cameras).

    It ends when there are enough key frames, with the patience or the route, or when the car touches something.
    """
    rng = np.random.default_rng([config.seed, number])
    plan = plan_episode(config, number, rng)
    observation, agent = begin_episode(world, config, plan, rng)
    mounts = _mounts(config, rng)
    disturbance, start = Disturbance(rng), LateStart(rng)
    frames = KeyFrames(round(config.duration / world.dt), plan.tailgating)
    with EpisodeWriter(episode_path(folder, number), plan.scenario) as writer:
        for index in range(frames.most):
            wanted = frames.takes(world.truth().affordances, observation.speed)
            clean = agent.act(observation)
            driven = start.apply(disturbance.apply(clean, observation.speed), observation.speed)
            if wanted:
                pair = Controls(clean, driven)
                for frame in _frames(world, observation, mounts, index, pair, config.semantic):
                    writer.append(frame)
            observation = world.step(driven)
            truth = world.truth()
            if frames.taken == frames.wanted or truth.contacts or truth.route_done >= truth.route_length - 5:
                break
    return frames.taken * len(mounts)


@dataclass(frozen=True)
class Controls:
    """What the driver wanted, and what moved the car."""

    clean: Control
    driven: Control


def _frames(
    world: RecordableWorld, observation: Observation, mounts: Sequence[CameraConfig], index: int, controls: Controls,
    semantic: bool,
) -> Iterator[Frame]:  # fmt: skip
    """What each camera sees at a moment, with its labels."""
    semantics = world.semantic_images(mounts) if semantic else [None] * len(mounts)
    seen = zip(mounts, world.images(mounts), semantics, strict=True)
    for camera, (mount, image, classes) in enumerate(seen):
        others = world.other_commands_at(mount)
        yield Frame(
            index=index, time=observation.time, speed=observation.speed, command=observation.command,
            affordances=world.labels_at(mount), driven=controls.driven, clean=controls.clean, image=image,
            camera=camera, camera_left=mount.left, camera_yaw=mount.yaw, semantic=classes,
            junction=world.route.inside_junction(world.truth().route_done),
            other=others[index % len(others)] if others else None,
        )  # fmt: skip
