"""How fast the world and the agent are on this machine, and where the time goes."""

from __future__ import annotations

import math
import os
from contextlib import closing
from dataclasses import dataclass
from importlib import import_module
from time import perf_counter

import numpy as np

from caldrive.agents.registry import agent_entry, make_cal
from caldrive.checks import MOST_SEED, MOST_WORKERS, require_within
from caldrive.control.controller import CALController, ControlConfig
from caldrive.datatypes import DT, KMH, Affordances, CameraConfig, Command, Observation, Pose, Truth, VehicleState
from caldrive.driving.own_code import next_step, reset_agent
from caldrive.driving.settings import AgentSpeedSettings, WorldSpeedSettings
from caldrive.driving.setup import make_world
from caldrive.interfaces import World, is_recordable
from caldrive.progress import Progress, silent
from caldrive.scenarios import Scenario
from caldrive.timing import Stopwatch

MAX_SPEED = 30.0  # km/h that the car under measurement drives at most
WARM_UP, MAX_STEPS = 20, 100_000  # steps that do not count, and those that one may ask for


@dataclass(frozen=True)
class WorldTiming:
    """How fast the world is."""

    steps_per_second: float
    """Steps by the time that they took."""
    median_ms: float
    """Of a step."""
    parts_ms: dict[str, float]
    """The median of each part of a step."""
    first_frame: float
    """Seconds from nothing to the first image, once the libraries are loaded."""
    imports: float
    """Seconds to load the libraries."""


def measure_world(settings: WorldSpeedSettings, progress: Progress = silent) -> WorldTiming:
    """Drive along a random route with the camera on. Raises ValueError as the world's reset does."""
    require_within("--steps", settings.steps, 1, MAX_STEPS, 600)
    require_within("--cars", settings.cars, 0, math.inf, 20)
    require_within("--people", settings.people, 0, math.inf, 50)
    require_within("--seed", settings.seed, 0, MOST_SEED, 0)
    begin = perf_counter()
    from caldrive.agents.cal import CALAgent, OraclePerception

    import_module("caldrive.world.embedded")  # what the world needs

    imported, stopwatch = perf_counter(), Stopwatch()
    world = make_world("embedded", CameraConfig(), stopwatch=stopwatch)
    agent = CALAgent(OraclePerception(world.truth), CALController(ControlConfig(cap=MAX_SPEED), world.dt))
    with closing(world):
        observation = _start(world, settings)
        first_frame = perf_counter() - imported
        for i in range(-WARM_UP, settings.steps):
            if i == 0:
                stopwatch.restart()
            control = agent.act(observation)
            start = perf_counter()
            observation = world.step(control)
            if i >= 0:
                stopwatch.lap(perf_counter() - start)
            progress("driving", (i + WARM_UP) / (settings.steps + WARM_UP))
    laps = [sum(lap.values()) for lap in stopwatch.laps]
    return WorldTiming(
        steps_per_second=len(laps) / sum(laps),
        median_ms=1000 * float(np.median(laps)),
        parts_ms={name: 1000 * seconds for name, seconds in stopwatch.medians().items()},
        first_frame=first_frame,
        imports=imported - begin,
    )


def _start(world: World, settings: WorldSpeedSettings) -> Observation:
    """Begin an episode along a random route that is long enough."""
    from caldrive.world.roads.route import random_route
    from caldrive.world.roads.towns import load_roads

    assert is_recordable(world)
    roads, rng = load_roads(settings.town), np.random.default_rng(settings.seed)
    length = (settings.steps + WARM_UP) * world.dt * MAX_SPEED * KMH + 50.0
    lane = max(roads.driveable, key=lambda lane: lane.line.length)
    route = random_route(roads, lane.line.pose_at(10.0), length, rng)
    scenario = Scenario(
        town=settings.town, weather=settings.weather, start=route.line.pose_at(0.0),
        goal=route.line.pose_at(route.length), n_vehicles=settings.cars, n_pedestrians=settings.people,
        seed=settings.seed, task="speed",
    )  # fmt: skip
    return world.reset(scenario, route=route)


@dataclass(frozen=True)
class AgentTiming:
    """How long an agent takes from image to control."""

    median_ms: float
    """In the median."""
    p99_ms: float
    """In 99 of 100 cases."""
    width: int
    """Of its camera's images, pixels."""
    height: int
    """Of its camera's images, pixels."""


def measure_agent(settings: AgentSpeedSettings, progress: Progress = silent) -> AgentTiming:
    """Run an agent on images of noise: how long it takes does not depend on what they show.

    Raises OwnCodeError where the agent fails, ValueError or FileNotFoundError where it cannot be made.
    """
    require_within("--steps", settings.steps, 1, MAX_STEPS, 300)
    threads = os.cpu_count() or 1 if settings.threads is None else settings.threads
    require_within("--threads", threads, 1, MOST_WORKERS, 2)
    entry = agent_entry(settings.agent)
    camera = entry.camera(settings) or CameraConfig()
    agent = make_cal(settings, DT, threads) if settings.agent == "cal" else entry.make(settings, DT, _empty_road)
    reset_agent(agent)
    rng, milliseconds = np.random.default_rng(0), []
    for i in range(WARM_UP + settings.steps):
        image = rng.integers(0, 256, (camera.height, camera.width, 3), np.uint8)
        observation = Observation(time=i * DT, image=image, speed=5.0, command=Command.STRAIGHT)
        start = perf_counter()
        next_step(agent, observation, i)
        milliseconds.append(1000 * (perf_counter() - start))
        progress("images", i / (WARM_UP + settings.steps))
    median, p99 = np.percentile(milliseconds[WARM_UP:], (50, 99))
    return AgentTiming(median_ms=float(median), p99_ms=float(p99), width=camera.width, height=camera.height)


def _empty_road() -> Truth:
    """The truth for an agent that goes by it, while only its own time counts."""
    return Truth(time=0.0, ego=VehicleState(Pose(0.0, 0.0, 0.0)), affordances=Affordances())
