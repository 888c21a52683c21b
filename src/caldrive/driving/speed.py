"""How fast the world and the agent are on this machine, and where the time goes."""

from __future__ import annotations

import math
import os
import platform
import resource
from contextlib import closing
from dataclasses import dataclass, replace
from importlib import import_module
from pathlib import Path
from statistics import median
from time import perf_counter

import numpy as np

from caldrive.agents.registry import agent_entry
from caldrive.agents.rows import make_cal
from caldrive.checks import MOST_SEED, MOST_WORKERS, require_within
from caldrive.control.controller import CALController, ControlConfig
from caldrive.datatypes import DT, KMH, CameraConfig, Observation
from caldrive.driving.own_code import next_step, reset_agent
from caldrive.driving.settings import AgentSpeedSettings, WorldSpeedSettings
from caldrive.driving.setup import make_world
from caldrive.interfaces import World, is_recordable
from caldrive.parallel.processes import parallel_map
from caldrive.progress import Progress, silent
from caldrive.scenarios import Scenario
from caldrive.timing import Stopwatch

MAX_SPEED = 30.0  # km/h that the car under measurement drives at most
BESIDE = 0.8  # m that the outer ones of three cameras stand beside the middle
WARM_UP, MAX_STEPS = 20, 100_000  # steps that do not count, and those that one may ask for


@dataclass(frozen=True)
class WorldTiming:
    """How fast the world is; of several, medians."""

    processor: str
    """Its name."""
    scene: str
    """What was drawn, by how many worlds."""
    steps_per_second: float
    """Steps by the time that they took, of all worlds together."""
    median_ms: float
    """Of a step."""
    parts_ms: dict[str, float]
    """The median of each part of a step."""
    first_frame: float
    """Seconds from nothing to the first image, once the libraries are loaded."""
    imports: float
    """Seconds to load the libraries."""
    memory_mb: float
    """The most memory that a process with a world took."""

    def over(self, other: WorldTiming) -> dict[str, float]:
        """By how many times another measurement is faster, by part; parts that take no time are left out."""
        both = {name: (ms, other.parts_ms.get(name, 0.0)) for name, ms in self.parts_ms.items()}
        ratios = {name: before / now for name, (before, now) in both.items() if now > 0}
        ratios["whole step"] = self.median_ms / other.median_ms
        if self.steps_per_second > 0:
            ratios["steps a second"] = other.steps_per_second / self.steps_per_second
        return ratios


def measure_world(settings: WorldSpeedSettings, progress: Progress = silent) -> WorldTiming:
    """Drive along a random route with the camera on, in as many processes as settings.workers. Raises ValueError as
    the world's reset does."""
    require_within("--steps", settings.steps, 1, MAX_STEPS, 600)
    require_within("--cars", settings.cars, 0, math.inf, 20)
    require_within("--people", settings.people, 0, math.inf, 50)
    require_within("--seed", settings.seed, 0, MOST_SEED, 0)
    require_within("--workers", settings.workers, 1, MOST_WORKERS, 2)
    if settings.workers == 1:
        return _measured(settings, progress)
    worlds = [timing for _, timing in parallel_map(_measured, [settings] * settings.workers, settings.workers)]
    return WorldTiming(
        processor=worlds[0].processor,
        scene=worlds[0].scene,
        steps_per_second=sum(world.steps_per_second for world in worlds),
        median_ms=median(world.median_ms for world in worlds),
        parts_ms={part: median(world.parts_ms[part] for world in worlds) for part in worlds[0].parts_ms},
        first_frame=median(world.first_frame for world in worlds),
        imports=median(world.imports for world in worlds),
        memory_mb=max(world.memory_mb for world in worlds),
    )


def _measured(settings: WorldSpeedSettings, progress: Progress = silent) -> WorldTiming:
    """One world, in this process."""
    begin = perf_counter()
    from caldrive.agents.cal import CALAgent, OraclePerception

    import_module("caldrive.world.embedded")  # what the world needs

    imported, stopwatch, mounts = perf_counter(), Stopwatch(), _mounts(settings.cameras)
    world = make_world("embedded", mounts[0], stopwatch=stopwatch)
    assert is_recordable(world)
    agent = CALAgent(OraclePerception(world.truth), CALController(ControlConfig(cap=MAX_SPEED), world.dt))
    with closing(world):
        observation = start_drive(world, settings)
        first_frame = perf_counter() - imported
        for i in range(-WARM_UP, settings.steps):
            if i == 0:
                stopwatch.restart()
            control = agent.act(observation)
            start = perf_counter()
            observation = world.step(control)
            if mounts[1:]:
                with stopwatch.part("camera"):
                    world.images(mounts[1:])
            if i >= 0:
                stopwatch.lap(perf_counter() - start)
            progress("driving", (i + WARM_UP) / (settings.steps + WARM_UP))
    laps = [sum(lap.values()) for lap in stopwatch.laps]
    return WorldTiming(
        processor=processor_name(),
        scene=scene_of(settings),
        steps_per_second=len(laps) / sum(laps),
        median_ms=1000 * float(np.median(laps)),
        parts_ms={name: 1000 * seconds for name, seconds in stopwatch.medians().items()},
        first_frame=first_frame,
        imports=imported - begin,
        memory_mb=resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
    )


def scene_of(settings: WorldSpeedSettings) -> str:
    """What a measurement draws: only the same can be compared."""
    return (
        f"{settings.town}, weather {settings.weather}, {settings.cars} cars, {settings.people} people, "
        f"{settings.cameras} cameras, {settings.workers} worlds, seed {settings.seed}"
    )


def _mounts(cameras: int) -> list[CameraConfig]:
    """The agent's camera, or three as in a recording."""
    return [replace(CameraConfig(), left=left) for left in (0.0, BESIDE, -BESIDE)[:cameras]]


def processor_name() -> str:
    """As the kernel knows it, with the fastest arithmetic on bytes that it has."""
    lines = Path("/proc/cpuinfo").read_text(errors="replace").splitlines() if Path("/proc/cpuinfo").exists() else []
    values = {line.partition(":")[0].strip(): line.partition(":")[2].strip() for line in lines}
    flags = values.get("flags", "").split()
    width = "AVX-512" if "avx512f" in flags else "AVX2" if "avx2" in flags else "no AVX2"
    vnni = "VNNI" if {"avx512_vnni", "avx_vnni"} & set(flags) else "no VNNI"
    return f"{values.get('model name', platform.processor() or 'unknown')} ({width}, {vnni})"


def start_drive(world: World, settings: WorldSpeedSettings) -> Observation:
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

    processor: str
    """Its name."""
    median_ms: float
    """In the median."""
    p99_ms: float
    """In 99 of 100 cases."""
    width: int
    """Of its camera's images, pixels."""
    height: int
    """Of its camera's images, pixels."""


def measure_agent(settings: AgentSpeedSettings, progress: Progress = silent) -> AgentTiming:
    """Let an agent drive in town01: in pictures that show no drive a camera check would make it blind.

    Raises OwnCodeError where the agent fails, ValueError or FileNotFoundError where it cannot be made.
    """
    require_within("--steps", settings.steps, 1, MAX_STEPS, 300)
    threads = os.cpu_count() or 1 if settings.threads is None else settings.threads
    require_within("--threads", threads, 1, MOST_WORKERS, 2)
    entry = agent_entry(settings.agent)
    camera = entry.camera(settings) or CameraConfig()
    aside = entry.auxiliary(settings)
    world = make_world("embedded", camera, **({"auxiliary": aside} if aside else {}))
    knows, milliseconds = world.truth if entry.privileged else None, list[float]()
    with closing(world):
        agent = make_cal(settings, DT, threads) if settings.agent == "cal" else entry.make(settings, DT, knows)
        reset_agent(agent)
        observation = start_drive(world, WorldSpeedSettings(steps=settings.steps))
        for i in range(WARM_UP + settings.steps):
            start = perf_counter()
            control, _ = next_step(agent, observation, i)
            milliseconds.append(1000 * (perf_counter() - start))
            observation = world.step(control)
            progress("images", i / (WARM_UP + settings.steps))
    half, most = np.percentile(milliseconds[WARM_UP:], (50, 99))
    return AgentTiming(
        processor=processor_name(), median_ms=float(half), p99_ms=float(most), width=camera.width, height=camera.height
    )
