"""One recorded episode: oracle and controller drive from somewhere in a town, three cameras look on (section 3.1).

Not every step of a drive becomes a key frame: a car that stands shows the same until what it should stop for changes,
and one that follows no other shows little to those who are to learn distances.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from caldrive.collection.config import CollectConfig
from caldrive.collection.perturbation import ControlPerturbation, DelayedStart
from caldrive.collection.start_poses import SEARCH, begin_episode, plan_episode
from caldrive.datatypes import Affordances, CameraConfig, Control, Observation
from caldrive.interfaces import RecordableWorld
from caldrive.recordings.writer import EpisodeWriter, Frame, episode_path

MAX_DURATION = 2  # times the wanted duration that a drive may last
FIRST_SHARE = 6  # one in so many of a tailgating drive's key frames are its first steps; later ones need a car
NEAR_CAR = 25.0  # m; a car ahead that is nearer makes a key frame of a tailgating drive
STANDING_SPEED = 0.1  # m/s
STANDING_STEPS = 15  # that are key frames when the car comes to stand,
RUN, PERIOD = 9, 135  # and then a run of so many in so many: single ones would have no history
BASELINES = (-0.5, 0.0, 0.5)  # m, + left (section 3.1)
MAX_YAW = math.radians(15)
ROUTE_MARGIN = 5.0  # m before the end of the route at which the episode ends


class KeyFrameSelector:
    """Says which steps of a drive are key frames, and when there are enough.

    wanted: how many. tailgating: of such a drive, the first steps are key frames, for the empty street, and then those
    where a car is near.
    """

    def __init__(self, wanted: int, tailgating: bool) -> None:
        self.wanted, self.tailgating = wanted, tailgating
        self.max_steps = (SEARCH if tailgating else MAX_DURATION) * wanted  # that the drive may last
        self.selected, self._index, self._standing, self._reasons = 0, 0, 0, (0.0, 0.0)

    def select(self, labels: Affordances, speed: float) -> bool:
        """Whether the next step is a key frame; speed in m/s."""
        reasons = labels.hazard_stop, labels.red_light
        self._standing = self._standing + 1 if speed < STANDING_SPEED and reasons == self._reasons else 0
        self._reasons = reasons
        is_key_frame = self._standing <= STANDING_STEPS or self._standing % PERIOD < RUN
        if self.tailgating:
            is_first = self._index < max(1, self.wanted // FIRST_SHARE)
            is_key_frame = is_key_frame and (is_first or labels.vehicle_distance < NEAR_CAR)
        self._index += 1
        self.selected += is_key_frame
        return is_key_frame


@dataclass(frozen=True)
class Controls:
    """What who knows the truth would do, and what moved the car."""

    clean: Control
    driven: Control


def record_episode(world: RecordableWorld, config: CollectConfig, number: int, folder: Path) -> int:
    """Drives and records one episode; returns its number of frames (key frames times cameras).

    It ends when there are enough key frames, when it takes too long, with the route, or when the car touches something.
    """
    rng = np.random.default_rng([config.seed, number])
    plan = plan_episode(config, number, rng)
    observation, agent, honest = begin_episode(world, config, plan, rng)
    cameras = _cameras(config, rng)
    perturbation, delay = ControlPerturbation(rng), DelayedStart(rng)
    selector = KeyFrameSelector(round(config.duration / world.dt), plan.tailgating)
    with EpisodeWriter(episode_path(folder, number), plan.scenario) as writer:
        for index in range(selector.max_steps):
            is_key_frame = selector.select(world.truth().affordances, observation.speed)
            wanted = agent.act(observation)
            clean = wanted if honest is agent else honest.act(observation)
            driven = delay.apply(perturbation.apply(wanted, observation.speed), observation.speed)
            if is_key_frame:
                controls = Controls(clean=clean, driven=driven)
                for frame in _frames(world, observation, cameras, index, controls, config.semantic):
                    writer.append(frame)
            observation = world.step(driven)
            truth = world.truth()
            at_end = truth.route_done >= truth.route_length - ROUTE_MARGIN
            if selector.selected == selector.wanted or truth.contacts or at_end:
                break
    return selector.selected * len(cameras)


def _cameras(config: CollectConfig, rng: np.random.Generator) -> list[CameraConfig]:
    """Three cameras, each turned at random."""
    yaws = rng.uniform(-MAX_YAW, MAX_YAW, size=len(BASELINES))
    return [
        CameraConfig(width=config.width, height=config.height, left=left, yaw=float(yaw))
        for left, yaw in zip(BASELINES, yaws, strict=True)
    ]


def _frames(
    world: RecordableWorld, observation: Observation, cameras: Sequence[CameraConfig], index: int, controls: Controls,
    semantic: bool,
) -> Iterator[Frame]:  # fmt: skip
    """What each camera sees in a step, with its labels."""
    semantics = world.semantic_images(cameras) if semantic else [None] * len(cameras)
    views = zip(cameras, world.images(cameras), semantics, strict=True)
    for k, (camera, image, classes) in enumerate(views):
        others = world.other_commands_at(camera)
        yield Frame(
            index=index, time=observation.time, speed=observation.speed, command=observation.command,
            affordances=world.labels_at(camera), driven=controls.driven, clean=controls.clean, image=image,
            camera=k, camera_left=camera.left, camera_yaw=camera.yaw, semantic=classes,
            junction=world.route.inside_junction(world.truth().route_done),
            other=others[index % len(others)] if others else None,
        )  # fmt: skip
