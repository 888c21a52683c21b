"""Suites of generated towns, each driven once a task: `unseen` and `unseen-wide`, whose towns nobody tuned to, and
`generated` to develop on.

Their routes are in generated_routes.json, and the networks of the unseen towns in the package, so that these need no
netconvert. `python -m caldrive.benchmark.generated_suites` draws both again.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import astuple, dataclass
from functools import lru_cache
from pathlib import Path
from typing import TypedDict

import numpy as np

from caldrive.datatypes import Pose
from caldrive.driving.tasks import TASKS, draw_routes, scaled_traffic, time_limit_of
from caldrive.files import write_whole
from caldrive.scenarios import HELD_OUT_FROM, GeneratedTown, Scenario
from caldrive.world.roads.generated import draw_town
from caldrive.world.roads.network import RoadNetwork
from caldrive.world.roads.packed_networks import pack
from caldrive.world.roads.route import plan_route

_DATA = Path(__file__).with_name("generated_routes.json")
TRIED_ROUTES = 25  # drawn for each task; the first of them without a change of lanes is driven
WEATHER_STRIDE = 2  # from a task to the next, so that each task has every weather


@dataclass(frozen=True)
class GeneratedSuite:
    """A suite of generated towns with consecutive seeds, one route a task."""

    name: str
    """Also that of its one condition."""
    kind: str
    """Of its towns."""
    first: int
    """The first town's seed."""
    n_towns: int
    tasks: tuple[str, ...] = TASKS
    weathers: tuple[int, ...] = tuple(range(1, 15))
    """They take turns."""

    @property
    def towns(self) -> list[GeneratedTown]:
        """By their numbers in the suite."""
        return [GeneratedTown(self.kind, self.first + k) for k in range(self.n_towns)]


GENERATED_SUITES = {
    suite.name: suite
    for suite in (
        GeneratedSuite("generated", "random", first=1000, n_towns=24, weathers=(1, 3, 6, 8)),
        GeneratedSuite("unseen", "random", first=HELD_OUT_FROM, n_towns=100),
        GeneratedSuite(
            "unseen-wide", "random-wide", first=HELD_OUT_FROM + 500_000, n_towns=40,
            tasks=("navigation", "navigation-dynamic"),
        ),
    )
}  # fmt: skip


class _TownRoutes(TypedDict):
    """What the file says of a town. roads: m of its streets; routes: start, goal and [length in m] by task."""

    roads: float
    routes: dict[str, list[list[float]]]


@lru_cache(maxsize=1)
def _drawn() -> dict[str, _TownRoutes]:
    drawn: dict[str, _TownRoutes] = json.loads(_DATA.read_text())
    return drawn


def generated_scenarios(name: str, seed: int = 0, time_limit: str = "paper") -> Iterator[tuple[str, Scenario]]:
    """The scenarios of one of GENERATED_SUITES with their keys, in the order of the towns. time_limit: as in
    `task_scenarios`."""
    suite = GENERATED_SUITES[name]
    for k, town in enumerate(suite.towns):
        drawn = _drawn()[town.name]
        for i, task in enumerate(suite.tasks):
            weather = suite.weathers[(k + WEATHER_STRIDE * i) % len(suite.weathers)]
            start, goal, (length,) = drawn["routes"][_kind(task)]
            cars, people = scaled_traffic(drawn["roads"]) if task == "navigation-dynamic" else (0, 0)
            scenario = Scenario(
                town=town.name, weather=weather, start=Pose(*start), goal=Pose(*goal), n_vehicles=cars,
                n_pedestrians=people, time_limit=time_limit_of(length, time_limit), seed=1000 * seed + k, task=task,
            )  # fmt: skip
            yield f"{name}-{k:03d}-w{weather:02d}-{task}", scenario


def _kind(task: str) -> str:
    """The task whose routes a task has."""
    return "navigation" if task == "navigation-dynamic" else task


def _draw_route(roads: RoadNetwork, task: str, rng: np.random.Generator) -> list[list[float]]:
    """Start, goal and [length in m] of a route of a task that can be driven without a change of lanes."""
    for pair in draw_routes(roads, task, TRIED_ROUTES, rng):
        start, goal = (Pose(*(round(value, 3) for value in astuple(pose))) for pose in pair)
        route = plan_route(roads, start, goal)
        if not route.changes:
            return [[*astuple(start)], [*astuple(goal)], [round(route.length, 2)]]
    raise ValueError(f"found no route for {task} in {roads.name} without a change of lanes, wanted one: try more")


def _draw_all() -> None:
    """Draws the towns of all suites and their routes again."""
    drawn, networks = dict[str, _TownRoutes](), dict[str, bytes]()
    for suite in GENERATED_SUITES.values():
        for town in suite.towns:
            roads, rng, routes = draw_town(town), np.random.default_rng([2018, town.seed]), {}
            if town.is_held_out:
                networks[town.name] = roads.network.read_bytes()
            for task in dict.fromkeys(map(_kind, suite.tasks)):
                routes[task] = _draw_route(roads, task, rng)
            drawn[town.name] = {"roads": round(roads.road_length, 1), "routes": routes}
            print(town.name, flush=True)
    write_whole(_DATA, (json.dumps(drawn, separators=(",", ":")) + "\n").encode())
    pack(networks)


if __name__ == "__main__":
    _draw_all()
