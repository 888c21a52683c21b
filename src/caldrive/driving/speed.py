"""How fast the world and the agent are on this machine, and where the time goes.

The world carries no timers of its own: here its parts' methods are wrapped, for the length of a measurement.
"""

from __future__ import annotations

import math
import os
from collections import defaultdict
from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass
from time import perf_counter
from typing import Any

import numpy as np

from caldrive.config import KMH, CameraConfig, ControlConfig
from caldrive.datatypes import Command, Observation, Scenario
from caldrive.driving.limits import MOST_SEED, MOST_WORKERS, require_within
from caldrive.driving.settings import AgentSpeedSettings, WorldSpeedSettings
from caldrive.progress import Progress, silent

PACE = 30.0  # km/h that the car under measurement drives at most
WARM_UP, MOST_STEPS = 20, 100_000  # steps that do not count, and those that one may ask for


class Stopwatch:
    """Seconds that each part takes in each lap. Parts must not call one another."""

    def __init__(self) -> None:
        self.laps: list[dict[str, float]] = []
        self._lap: dict[str, float] = defaultdict(float)

    def wrap(self, thing: Any, method: str, part: str) -> None:
        """From now on the time in thing.method counts for a part."""
        inner: Callable[..., Any] = getattr(thing, method)

        def timed(*args: Any, **kwargs: Any) -> Any:
            begin = perf_counter()
            try:
                return inner(*args, **kwargs)
            finally:
                self._lap[part] += perf_counter() - begin

        setattr(thing, method, timed)

    def lap(self, whole: float) -> None:
        """Ends a lap that took `whole` seconds in all; what no part took is the rest."""
        self._lap["rest"] = whole - sum(self._lap.values())
        self.laps.append(dict(self._lap))
        self._lap.clear()

    def medians(self) -> dict[str, float]:
        """Median seconds a lap of each part."""
        parts = {name for lap in self.laps for name in lap}
        return {name: float(np.median([lap.get(name, 0.0) for lap in self.laps])) for name in sorted(parts)}


@dataclass(frozen=True)
class WorldSpeed:
    """steps_per_second: steps by the time that they took; median_ms of a step, and of each of its parts; first_frame
    and imports: seconds from nothing to the first image, and to load the libraries before it."""

    steps_per_second: float
    median_ms: float
    parts_ms: dict[str, float]
    first_frame: float
    imports: float


def measure_world(settings: WorldSpeedSettings, progress: Progress = silent) -> WorldSpeed:
    """Drive along a random route with the camera on. Raises ValueError as the world's reset does."""
    require_within("--steps", settings.steps, 1, MOST_STEPS, 600)
    require_within("--cars", settings.cars, 0, math.inf, 20)
    require_within("--people", settings.people, 0, math.inf, 50)
    require_within("--seed", settings.seed, 0, MOST_SEED, 0)
    begin = perf_counter()
    from caldrive.driving.drivers import oracle

    imported = perf_counter()
    world, agent = oracle(CameraConfig(), ControlConfig(cap=PACE))
    with closing(world):
        observation = _start(world, settings)
        first_frame = perf_counter() - imported
        watch = Stopwatch()
        for i in range(-WARM_UP, settings.steps):
            if i == 0:
                _wrap_parts(world, watch)
            control = agent.act(observation)
            start = perf_counter()
            observation = world.step(control)
            if i >= 0:
                watch.lap(perf_counter() - start)
            progress("driving", (i + WARM_UP) / (settings.steps + WARM_UP))
    whole = [sum(lap.values()) for lap in watch.laps]
    parts = {name: 1000 * value for name, value in watch.medians().items()}
    return WorldSpeed(len(whole) / sum(whole), 1000 * float(np.median(whole)), parts, first_frame, imported - begin)


def _start(world: Any, settings: WorldSpeedSettings) -> Observation:
    """Begin an episode along a random route that is long enough."""
    from caldrive.world.route import random_route
    from caldrive.world.weather import weather

    weather(settings.weather)
    roads, rng = world.enter(settings.town), np.random.default_rng(settings.seed)
    length = (settings.steps + WARM_UP) * world.dt * PACE * KMH + 50.0
    lane = max(roads.driveable, key=lambda one: one.line.length)
    route = random_route(roads, lane.line.pose_at(10.0), length, rng)
    start, goal = route.line.pose_at(0.0), route.line.pose_at(route.length)
    scenario = Scenario(
        settings.town, settings.weather, start, goal, settings.cars, settings.people, math.inf, settings.seed, "speed"
    )
    first: Observation = world.start(scenario, route)
    return first


def _wrap_parts(world: Any, watch: Stopwatch) -> None:
    """Where the time of a step goes."""
    for thing, method, part in (
        (world, "_touch", "contacts"),
        (world, "_find_truth", "labels and truth"),
        (world, "images", "camera"),
        (world.lights, "step", "lights"),
        (world.lights, "shown", "lights"),
        (world.pedestrians, "step", "pedestrians"),
        (world.pedestrians, "states", "pedestrians"),
        (world.traffic, "step", "traffic (SUMO)"),
    ):
        if thing is not None:
            watch.wrap(thing, method, part)


@dataclass(frozen=True)
class AgentSpeed:
    """Milliseconds from image to control: the median and the 99th percentile; network: its size in pixels."""

    median_ms: float
    p99_ms: float
    width: int
    height: int


def measure_agent(settings: AgentSpeedSettings, progress: Progress = silent) -> AgentSpeed:
    """Run perception and controller on images of noise: how long they take does not depend on what they show."""
    require_within("--steps", settings.steps, 1, MOST_STEPS, 300)
    threads = os.cpu_count() or 1 if settings.threads is None else settings.threads
    require_within("--threads", threads, 1, MOST_WORKERS, 2)
    from caldrive.driving.drivers import network_agent

    agent, camera = network_agent(settings.model, ControlConfig(), threads)
    agent.reset()
    rng, took = np.random.default_rng(0), []
    for i in range(WARM_UP + settings.steps):
        image = rng.integers(0, 256, (camera.height, camera.width, 3), np.uint8)
        start = perf_counter()
        agent.act(Observation(0.1 * i, image, 5.0, Command.STRAIGHT))
        took.append(1000 * (perf_counter() - start))
        progress("images", i / (WARM_UP + settings.steps))
    median, p99 = np.percentile(took[WARM_UP:], (50, 99))
    return AgentSpeed(float(median), float(p99), camera.width, camera.height)
