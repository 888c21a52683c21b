"""The recorder: oracle and controller drive a town, three cameras look on (section 3.1).

Every episode depends on (seed, its number) only, so that a recording that was interrupted goes on and ends with the
same files as an unbroken one.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Sequence
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from caldrive.config import CameraConfig, CollectConfig, ControlConfig, LongitudinalConfig
from caldrive.control.controller import Controller
from caldrive.datatypes import Control, Scenario
from caldrive.driving.agent import CALAgent, OraclePerception
from caldrive.driving.distracted import HiddenCars, Tailgater
from caldrive.driving.disturbance import Disturbance, LateStart
from caldrive.driving.limits import MOST_PIXELS, MOST_SEED, MOST_WORKERS, require_within
from caldrive.driving.moments import SEARCH, moments
from caldrive.driving.pool import spread
from caldrive.driving.starts import starting_place
from caldrive.episodes import FORMAT_VERSION, EpisodeWriter, Frame
from caldrive.files import write_whole
from caldrive.world.embedded import EmbeddedWorld
from caldrive.world.route import random_route
from caldrive.world.towns import load_town
from caldrive.world.weather import weather

BASELINES = (-0.5, 0.0, 0.5)  # m, + left (section 3.1)
MANIFEST = "manifest.json"
ASIDE, ASKEW = (-1.5, 4.0), 0.4  # m to the left, from the kerb to the opposite lane, and rad
MAX_YAW = math.radians(15)
GAPS = (0.4, 4.0)  # m behind other cars, of those who tailgate
CAPS = (20.0, 20.0, None)  # km/h: the pace of the comparison with the baselines, a tailgater's, and the signs'
FAST, SLOW = 14, 6  # m/s; no episode is faster in the mean, and no tailgater's


def episode_path(folder: Path, number: int) -> Path:
    return folder / f"episode-{number:05d}.parquet"


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
        labels = world.labels_at(mount.left, mount.yaw)
        others = world.alternatives_at(mount.left, mount.yaw)
        other = others[index % len(others)] if others else None
        yield Frame(
            index, observation.time, observation.speed, observation.command, labels, driven, clean, image, camera,
            mount.left, mount.yaw, semantic, inside, other,
        )  # fmt: skip


def _set_up(
    world: EmbeddedWorld, config: CollectConfig, number: int, tailgating: bool, rng: np.random.Generator
) -> tuple[Scenario, CALAgent]:
    """A random start and random turns; returns the scenario and the driver, both ready."""
    arrangement = int(rng.integers(1, 2**31))
    roads = world.enter(config.town, arrangement if rng.random() < config.rearranged else 0)
    rare = (0.0, 0.0) if tailgating else (config.before_signs, config.before_turns)
    start, turn = starting_place(roads, *rare, rng)
    way = config.duration * (SEARCH * SLOW if tailgating else FAST) + 50
    route = random_route(roads, start, way, rng, turn)
    under = config.weathers[number % len(config.weathers)]
    cars = _cars(config, tailgating, rng)
    seed = int(rng.integers(2**31))
    scenario = Scenario(
        config.town, under, start, route.line.pose_at(route.length), cars, config.people, config.duration,
        seed, "collect", config.crossing,
    )  # fmt: skip
    cap = CAPS[0] if tailgating else CAPS[int(rng.integers(len(CAPS)))]
    oracle = _oracle(world, config, tailgating, rng)
    # Whom no car is told of must not take one for nothing, however long it stands there.
    laws = replace(LongitudinalConfig(), hazard_patience=math.inf, red_patience=math.inf)
    agent = CALAgent(oracle, Controller(ControlConfig(laws, cap=cap)))
    world.start(scenario, route)
    if rng.random() < config.displaced:
        world.displace(float(rng.uniform(*ASIDE)), float(rng.uniform(-ASKEW, ASKEW)))
    agent.reset()
    return scenario, agent


def _cars(config: CollectConfig, tailgating: bool, rng: np.random.Generator) -> int:
    """How many others drive."""
    if tailgating:
        return 2 * config.cars
    return config.cars if rng.random() < 0.5 else config.cars // 3


def _oracle(
    world: EmbeddedWorld, config: CollectConfig, tailgating: bool, rng: np.random.Generator
) -> OraclePerception:
    """Who tells the controller of the town: the truth, or what makes the driver come close to cars."""
    if tailgating:
        return Tailgater(world.truth, float(rng.uniform(*GAPS)))
    return (HiddenCars if rng.random() < config.hidden_cars else OraclePerception)(world.truth)


_world: EmbeddedWorld | None = None


def _record(config: CollectConfig, folder: Path, number: int) -> int:
    """One episode in this process' own world."""
    global _world
    if _world is None:
        _world = EmbeddedWorld()
    return record_episode(_world, config, number, folder)


def _check(config: CollectConfig, workers: int) -> None:
    """Raises ValueError or FileNotFoundError for what cannot be recorded, before anything is written."""
    limits = {
        "episodes": (1, 100_000), "duration": (0.1, 3600.0), "cars": (0, math.inf), "people": (0, math.inf),
        "width": (16, MOST_PIXELS), "height": (16, MOST_PIXELS), "seed": (0, MOST_SEED), "rearranged": (0.0, 1.0),
        "workers": (1, MOST_WORKERS),
    }  # fmt: skip
    asked, usual = asdict(config) | {"workers": workers}, asdict(CollectConfig()) | {"workers": 2}
    for name, (low, high) in limits.items():
        require_within(f"--{name}", asked[name], low, high, usual[name])
    if not config.weathers:
        raise ValueError("found no weather in --weathers, wanted one or more: type --weathers 1 8 3 1 8 6")
    for number in config.weathers:
        weather(number)
    load_town(config.town)


def _read_manifest(path: Path) -> dict[str, Any]:
    try:
        found = json.loads(path.read_text())
    except ValueError:
        found = None
    if not isinstance(found, dict):
        raise ValueError(f"found that {path} is damaged, wanted a recording's settings: give another --out")
    return found


def _claim(folder: Path, config: CollectConfig) -> None:
    """Writes down what is recorded in a folder. Raises ValueError where that is something else already."""
    manifest = folder / MANIFEST
    wanted = json.loads(json.dumps(asdict(config) | {"format": FORMAT_VERSION}))
    del wanted["episodes"]  # a recording may grow
    if manifest.is_file():
        found = _read_manifest(manifest)
    elif any(folder.glob("*.parquet")):
        raise ValueError(f"found episodes in {folder}, but no {MANIFEST} that says how they came: give another --out")
    else:
        found = wanted
    for name, value in wanted.items():
        if found.get(name) != value:
            raise ValueError(
                f"found in {folder} a recording with {name} {found.get(name)}, wanted {value}: give another --out"
            )
    write_whole(manifest, (json.dumps(wanted, indent=2) + "\n").encode())


def collect(config: CollectConfig, folder: Path, workers: int = 1) -> Iterator[tuple[int, int]]:
    """Records what is missing in a folder; yields (episode, frames) as they are done.

    Where a worker dies, new ones go on. Raises ValueError where the folder holds a recording with other settings,
    RuntimeError where workers die again and again.
    """
    _check(config, workers)
    _claim(folder, config)
    yield from spread(partial(_record, config, folder), _missing(config, folder), workers)


def _missing(config: CollectConfig, folder: Path) -> list[int]:
    return [k for k in range(config.episodes) if not episode_path(folder, k).exists()]
