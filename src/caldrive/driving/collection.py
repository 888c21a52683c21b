"""The recorder: oracle and controller drive a town, three cameras look on (section 3.1).

Every episode depends on (seed, its number) only, so that a recording that was interrupted goes on and ends with the
same files as an unbroken one.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass, replace
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np

from caldrive.config import CameraConfig, ControlConfig
from caldrive.control.controller import Controller
from caldrive.datatypes import MAX_VEHICLE_DISTANCE, Affordances, Control, Observation, Pose, Scenario
from caldrive.driving.agent import CALAgent, OraclePerception
from caldrive.episodes import FORMAT_VERSION, EpisodeWriter, Frame
from caldrive.files import write_whole
from caldrive.world.embedded import EmbeddedWorld
from caldrive.world.roads import Lane, RoadNetwork
from caldrive.world.route import random_route
from caldrive.world.towns import load_town
from caldrive.world.weather import weather

BASELINES = (-0.5, 0.0, 0.5)  # m, + left (section 3.1)
MANIFEST = "manifest.json"
MAX_YAW = math.radians(15)
CAPS = (20.0, 20.0, None)  # km/h: the pace of the comparison with the baselines, and the signs'


@dataclass(frozen=True)
class CollectConfig:
    """What to record. duration: s of an episode. crossing: how much more people cross than usual.
    before_signs: share of all episodes that begin before a sign. hidden_cars: share of all episodes whose driver is
    told of no car ahead.
    """

    town: str = "town01"
    weathers: tuple[int, ...] = (1, 3, 6, 8)
    episodes: int = 240
    duration: float = 40.0
    cars: int = 20
    people: int = 70
    crossing: float = 3.0
    before_signs: float = 0.5
    hidden_cars: float = 0.1
    width: int = 200
    height: int = 88
    seed: int = 0


class Disturbance:
    """Short pushes at wheel and pedals, so that recoveries are seen: triangular pulses at random times."""

    def __init__(self, rng: np.random.Generator) -> None:
        self.rng, self.left, self.length, self.steer, self.pedal = rng, 0, 1, 0.0, 0.0

    def apply(self, control: Control, speed: float) -> Control:
        """The disturbed control. The faster the car, the weaker the push at the wheel."""
        if self.left == 0:
            if speed > 2.0 and self.rng.random() < 0.015:
                self.left = self.length = int(self.rng.integers(6, 14))
                self.steer = float(self.rng.uniform(-0.4, 0.4)) * min(1.0, 6.0 / speed)
                self.pedal = float(self.rng.choice([0.0, 0.0, -0.4, 0.5]))
            return control
        push = 1 - abs(2 * self.left / self.length - 1)
        self.left -= 1
        effort = control.throttle - control.brake + push * self.pedal * (control.brake < 0.3)
        steer = float(np.clip(control.steer + push * self.steer, -1, 1))
        return Control(float(np.clip(effort, 0, 1)), float(np.clip(-effort, 0, 1)), steer)


class _HiddenCars(OraclePerception):
    """Tells the controller that nobody drives ahead: it comes so close that hazard stops behind cars are seen.

    The paper sets the distance to zero for this end; its own following law would then stop the car at once.
    """

    def predict(self, observation: Observation) -> Affordances:
        return replace(super().predict(observation), vehicle_distance=MAX_VEHICLE_DISTANCE)


def episode_path(folder: Path, number: int) -> Path:
    return folder / f"episode-{number:05d}.parquet"


def record_episode(world: EmbeddedWorld, config: CollectConfig, number: int, folder: Path) -> int:
    """Drives and records one episode; returns its number of frames (moments times cameras)."""
    rng = np.random.default_rng([config.seed, number])
    scenario, agent = _set_up(world, config, number, rng)
    yaws = rng.uniform(-MAX_YAW, MAX_YAW, size=len(BASELINES))
    mounts = [
        CameraConfig(config.width, config.height, left=left, yaw=float(yaw))
        for left, yaw in zip(BASELINES, yaws, strict=True)
    ]
    disturbance, frames = Disturbance(rng), 0
    with EpisodeWriter(episode_path(folder, number), scenario) as writer:
        for index, observation in enumerate(_moments(world, config)):
            clean = agent.act(observation)
            driven = disturbance.apply(clean, observation.speed)
            for camera, (mount, image) in enumerate(zip(mounts, world.images(mounts), strict=True)):
                labels = world.labels_at(mount.left, mount.yaw)
                writer.append(
                    Frame(index, observation.time, observation.speed, observation.command, labels, driven, clean,
                          image, camera, mount.left, mount.yaw)
                )  # fmt: skip
            frames += len(mounts)
            world.step(driven)
    return frames


def starting_place(roads: RoadNetwork, before_signs: float, rng: np.random.Generator) -> Pose:
    """Anywhere on the roads, or in a share of the cases some way before a sign; each limit gets as many of these."""
    lanes = [lane for lane in roads.driveable if lane.line.length > 12]
    lane = lanes[int(rng.integers(len(lanes)))]
    s = float(rng.uniform(3, lane.line.length - 3))
    limits = sorted({sign.limit for sign in roads.signs})
    if limits and rng.random() < before_signs:
        limit = limits[int(rng.integers(len(limits)))]
        signs = [sign for sign in roads.signs if sign.limit == limit]
        lane, at = roads.lane_at(signs[int(rng.integers(len(signs)))].pose)
        return _upstream(roads, lane, at - float(rng.uniform(15, 60)))
    return lane.line.pose_at(s)


def _upstream(roads: RoadNetwork, lane: Lane, s: float) -> Pose:
    """The place s m along a lane; where that is negative, as far up the street before it, but inside no junction."""
    before = [one for one in roads.lanes.values() if lane.id in one.successors]
    if s >= 1 or len(before) != 1 or before[0].turn is not None:
        return lane.line.pose_at(max(s, 1.0))
    return _upstream(roads, before[0], s + before[0].line.length)


def _set_up(
    world: EmbeddedWorld, config: CollectConfig, number: int, rng: np.random.Generator
) -> tuple[Scenario, CALAgent]:
    """A random start and random turns; returns the scenario and the driver."""
    roads = world.enter(config.town)
    start = starting_place(roads, config.before_signs, rng)
    route = random_route(roads, start, config.duration * 14 + 50, rng)
    under = config.weathers[number % len(config.weathers)]
    seed = int(rng.integers(2**31))
    scenario = Scenario(
        config.town, under, start, route.line.pose_at(route.length), config.cars, config.people, config.duration,
        seed, "collect", config.crossing,
    )  # fmt: skip
    cap = CAPS[int(rng.integers(len(CAPS)))]
    hidden = rng.random() < config.hidden_cars
    oracle = (_HiddenCars if hidden else OraclePerception)(world.truth)
    agent = CALAgent(oracle, Controller(replace(ControlConfig(), cap=cap)))
    world.start(scenario, route)
    agent.reset()
    return scenario, agent


def _moments(world: EmbeddedWorld, config: CollectConfig) -> Iterator[Observation]:
    """Observations until time is up, the route ends or the car touches something."""
    for _ in range(round(config.duration / world.dt)):
        yield world.observation
        truth = world.truth()
        if truth.contacts or truth.route_done >= truth.route_length - 5:
            return


_world: EmbeddedWorld | None = None


def _record(config: CollectConfig, number: int, folder: Path) -> int:
    """One episode in this process' own world."""
    global _world
    if _world is None:
        _world = EmbeddedWorld()
    return record_episode(_world, config, number, folder)


def _check(config: CollectConfig, workers: int) -> None:
    """Raises ValueError or FileNotFoundError for what cannot be recorded, before anything is written."""
    least = {"episodes": 1, "duration": 0.1, "width": 16, "height": 16, "seed": 0, "workers": 1}
    asked = asdict(config) | {"workers": workers}
    for name, low in least.items():
        if not asked[name] >= low:
            raise ValueError(f"found --{name} {asked[name]}, wanted at least {low}: type --{name} {low}")
    if not config.weathers:
        raise ValueError("found no weather in --weathers, wanted one or more: type --weathers 1 3 6 8")
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

    Raises ValueError where the folder holds a recording with other settings.
    """
    _check(config, workers)
    _claim(folder, config)
    missing = [k for k in range(config.episodes) if not episode_path(folder, k).exists()]
    if workers == 1:
        yield from ((k, _record(config, k, folder)) for k in missing)
        return
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
        jobs = [(k, pool.submit(_record, config, k, folder)) for k in missing]
        yield from ((k, job.result()) for k, job in jobs)
