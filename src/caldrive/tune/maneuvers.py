"""The maneuvers that a controller is tuned on: six on a single road, and routes of a town without its camera.

All are driven with the true affordances: what goes wrong is the controller's.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from caldrive.agents.cal import CALAgent, OraclePerception
from caldrive.control.controller import CALController, ControlConfig
from caldrive.datatypes import KMH, Command, Points, Pose, Step
from caldrive.driving.referee import Referee
from caldrive.driving.rollout import run_episode
from caldrive.driving.setup import make_world
from caldrive.driving.tasks import TASKS, task_scenarios
from caldrive.geometry import Polyline
from caldrive.interfaces import World
from caldrive.scenarios import Scenario, require_to_learn_from
from caldrive.tune.road import SingleRoad, turn_route
from caldrive.tune.signals import Drive, signals

ROUTE_TASK = TASKS[3]  # among cars and people


@dataclass(frozen=True)
class Maneuver:
    """Something to drive."""

    title: str
    world: Callable[[], World]
    """Makes the world, anew for each drive."""
    scenario: Scenario
    """From where to where, and for how long."""


def drive(maneuver: Maneuver, config: ControlConfig) -> Drive:
    """Drives it with the true affordances, speed signs included."""
    world = maneuver.world()
    agent = CALAgent(OraclePerception(world.truth), CALController(config, world.dt))
    steps: list[Step] = []
    try:
        referee = Referee(maneuver.scenario, signs=True)
        result = run_episode(world, agent, maneuver.scenario, steps.append, referee=referee)
    finally:
        world.close()
    return Drive(signals(steps, world.dt), result)


def route(number: int, town: str = "town01") -> Maneuver:
    """A route of a town, among cars and people. number: from 0. Raises ValueError for a town that only judges, and for
    a number that it does not have."""
    require_to_learn_from(town)
    scenarios = task_scenarios(town, ROUTE_TASK)
    if not 0 <= number < len(scenarios):
        raise ValueError(f"found route {number} of {town}, wanted 0 to {len(scenarios) - 1}: take another")
    return Maneuver(f"route {number} of {town}", make_world, scenarios[number])


def _on_road(title: str, end: float, seconds: float, road: Callable[[], SingleRoad], left: float = 0.0) -> Maneuver:
    """From the road's beginning, so many metres to the left of its middle, to its arc length `end`."""
    points = road().route
    goal = Pose(end, 0.0, 0.0) if points is None else Polyline(points).pose_at(end)
    return Maneuver(title, road, Scenario("single road", 1, Pose(0.0, left, 0.0), goal, time_limit=seconds, task=title))


def _winding_road() -> Points:
    """A bend to the left, then one to the right (N, 2)."""
    left = turn_route(18, 1, after=10)
    corner = left[-1]
    back = turn_route(18, -1, before=10)
    return np.concatenate([left, corner + np.stack([-back[1:, 1], back[1:, 0]], axis=1)])


def braking_car(time: float) -> float:
    """The rear bumper (m) of a car that drives 30 km/h, brakes from 6 s on with 3 m/s² to a stand, and from 14 s on
    speeds up with 1.5 m/s² to 25 km/h."""
    fast, slow, brake, pull = 30 * KMH, 25 * KMH, 3.0, 1.5
    braking = min(max(time - 6.0, 0.0), fast / brake)
    pulling = min(max(time - 14.0, 0.0), slow / pull)
    rest = max(time - 14.0 - slow / pull, 0.0)
    return 22.0 + fast * min(time, 6.0) + fast * braking - brake * braking**2 / 2 + pull * pulling**2 / 2 + slow * rest


def _turn(command: Command, radius: float, side: int) -> SingleRoad:
    points = turn_route(radius, side)
    return SingleRoad(points, speed=30, command=command, turn_from=20, turn_until=45 + radius * math.pi / 2)


MANEUVERS: Mapping[str, Maneuver] = {
    "speed": _on_road(
        "steps of the speed limit: 30, 60, 30 km/h", 450.0, 60.0, lambda: SingleRoad(signs=((80, 60), (300, 30)))
    ),
    "light": _on_road(
        "a red light, then green", 140.0, 40.0, lambda: SingleRoad(speed=30, light=80, green_at=15)
    ),
    "follow": _on_road(
        "a car ahead brakes to a stand", 120.0, 45.0, lambda: SingleRoad(speed=30, lead=braking_car, lead_speed=30)
    ),
    "bend": _on_road(
        "two bends, from half a metre beside the line", 140.0, 40.0, lambda: SingleRoad(_winding_road(), speed=30), -0.5
    ),
    "left": _on_road("a left turn", 100.0, 40.0, lambda: _turn(Command.LEFT, 10, 1)),
    "right": _on_road("a right turn", 95.0, 40.0, lambda: _turn(Command.RIGHT, 6, -1)),
}  # fmt: skip
