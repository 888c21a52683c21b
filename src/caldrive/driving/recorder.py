"""One recorded episode: oracle and controller drive from somewhere in a town, three cameras look on (section 3.1)."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from caldrive.config import CameraConfig, CollectConfig, ControlConfig, LongitudinalConfig
from caldrive.control.controller import Controller
from caldrive.datatypes import Control, Scenario
from caldrive.driving.agent import CALAgent, OraclePerception
from caldrive.driving.distracted import HiddenCars, Tailgater
from caldrive.driving.disturbance import Disturbance, LateStart
from caldrive.driving.moments import SEARCH, moments
from caldrive.driving.starts import starting_place
from caldrive.episodes import EpisodeWriter, Frame, episode_path
from caldrive.world.embedded import EmbeddedWorld
from caldrive.world.route import Route, random_route
from caldrive.world.traffic import room

BASELINES = (-0.5, 0.0, 0.5)  # m, + left (section 3.1)
ASIDE, ASKEW = (-1.5, 4.0), 0.4  # m to the left, from the kerb to the opposite lane, and rad
MAX_YAW = math.radians(15)
GAPS = (0.4, 4.0)  # m behind other cars, of those who tailgate
CAPS = (20.0, 20.0, None)  # km/h, one of them at random, None for the signs alone; tailgaters have the first
FAST, SLOW = 14, 6  # m/s; no episode is faster in the mean, and no tailgater's


def record_episode(world: EmbeddedWorld, config: CollectConfig, number: int, folder: Path) -> int:
    """Drives and records one episode; returns its number of frames (moments times cameras)."""
    rng = np.random.default_rng([config.seed, number])
    tailgating = rng.random() < config.tailgating
    scenario, agent = _set_up(world, config, number, tailgating, rng)
    yaws = rng.uniform(-MAX_YAW, MAX_YAW, size=len(BASELINES))
    mounts = [
        CameraConfig(config.width, config.height, left=left, yaw=float(yaw))
        for left, yaw in zip(BASELINES, yaws, strict=True)
    ]
    disturbance, start, frames = Disturbance(rng), LateStart(rng), 0
    with EpisodeWriter(episode_path(folder, number), scenario) as writer:
        for index, observation, telling in moments(world, config.duration, tailgating):
            clean = agent.act(observation)
            driven = start.apply(disturbance.apply(clean, observation.speed), observation.speed)
            if telling:
                for frame in _frames(world, config, mounts, index, clean, driven):
                    writer.append(frame)
                frames += len(mounts)
            world.step(driven)
    return frames


def _frames(
    world: EmbeddedWorld,
    config: CollectConfig,
    mounts: Sequence[CameraConfig],
    index: int,
    clean: Control,
    driven: Control,
) -> Iterator[Frame]:
    """What each camera sees at a moment, with its labels."""
    observation, inside = world.observation, world.route.inside_junction(world.progress)
    semantics = world.semantic_images(mounts) if config.semantic else [None] * len(mounts)
    seen = zip(mounts, world.images(mounts), semantics, strict=True)
    for camera, (mount, image, semantic) in enumerate(seen):
        labels = world.labels_at(mount)
        others = world.alternatives_at(mount)
        other = others[index % len(others)] if others else None
        yield Frame(
            index, observation.time, observation.speed, observation.command, labels, driven, clean, image, camera,
            mount.left, mount.yaw, semantic, inside, other,
        )  # fmt: skip


def _set_up(
    world: EmbeddedWorld, config: CollectConfig, number: int, tailgating: bool, rng: np.random.Generator
) -> tuple[Scenario, CALAgent]:
    """A random start and random turns; returns the scenario and the driver, both ready."""
    scenario, route = _way(world, config, number, tailgating, rng)
    cap = CAPS[0] if tailgating else CAPS[int(rng.integers(len(CAPS)))]
    # Whom no car is told of must not take one for nothing, however long it stands there.
    laws = replace(LongitudinalConfig(), hazard_patience=math.inf, red_patience=math.inf)
    agent = CALAgent(_oracle(world, config, tailgating, rng), Controller(ControlConfig(laws, cap=cap)))
    world.start(scenario, route)
    if rng.random() < config.displaced:
        world.displace(float(rng.uniform(*ASIDE)), float(rng.uniform(-ASKEW, ASKEW)))
    agent.reset()
    return scenario, agent


def _way(
    world: EmbeddedWorld, config: CollectConfig, number: int, tailgating: bool, rng: np.random.Generator
) -> tuple[Scenario, Route]:
    """Enters the town in some look; returns where to drive, and among whom."""
    arrangement = int(rng.integers(1, 2**31))
    roads = world.enter(config.town, arrangement if rng.random() < config.rearranged else 0)
    rare = (0.0, 0.0) if tailgating else (config.before_signs, config.before_turns)
    start, turn = starting_place(roads, world.signs, *rare, rng)
    length = config.duration * (SEARCH * SLOW if tailgating else FAST) + 50
    route = random_route(roads, start, length, rng, turn)
    scenario = Scenario(
        config.town, config.weathers[number % len(config.weathers)], start, route.line.pose_at(route.length),
        _cars(config, tailgating, room(roads), rng), config.people, config.duration, int(rng.integers(2**31)),
        "collect", config.crossing,
    )  # fmt: skip
    return scenario, route


def _cars(config: CollectConfig, tailgating: bool, most: int, rng: np.random.Generator) -> int:
    """How many others drive; most: for how many there is room."""
    if tailgating:
        return min(2 * config.cars, most)
    return config.cars if rng.random() < 0.5 else config.cars // 3


def _oracle(
    world: EmbeddedWorld, config: CollectConfig, tailgating: bool, rng: np.random.Generator
) -> OraclePerception:
    """Who tells the controller of the town: the truth, or what makes the driver come close to cars."""
    if tailgating:
        return Tailgater(world.truth, float(rng.uniform(*GAPS)))
    return (HiddenCars if rng.random() < config.hidden_cars else OraclePerception)(world.truth)
