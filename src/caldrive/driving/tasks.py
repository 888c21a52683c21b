"""The four tasks of the benchmark (section 4): going straight, one turn, navigation, navigation among others.

The package's towns have 25 fixed routes for each task; `python -m caldrive.driving.tasks` draws them anew. Other maps
get random ones.
"""

from __future__ import annotations

import json
import math
from functools import lru_cache
from pathlib import Path

import numpy as np

from caldrive.datatypes import KMH, Command, Pose
from caldrive.geometry import wrap_angle
from caldrive.scenarios import Scenario
from caldrive.world.roads.network import RoadNetwork
from caldrive.world.roads.route import Route, plan_route
from caldrive.world.roads.towns import TOWNS, load_roads

TASKS = ("straight", "one-turn", "navigation", "navigation-dynamic")

ROUTES_PER_TASK = 25
USUAL_TRAFFIC = {"town01": (20, 50), "town02": (15, 50)}  # cars and people of the dynamic task
_DATA = Path(__file__).with_name("routes.json")
_FROM_STOP_LINE, _FROM_LANE_START = 25.0, 6.0  # m kept between a start and the ends of its lane
# Shortest and longest route of a task in metres, for a town of 400 m; others scale with their size.
_LENGTHS = {"straight": (90.0, 300.0), "one-turn": (130.0, 420.0), "navigation": (400.0, 1000.0)}


def _fits(route: Route, task: str) -> bool:
    turns = sum(turn.command is not Command.STRAIGHT for turn in route.turns)
    bends = abs(wrap_angle(route.line.heading_at(0) - route.line.heading_at(route.length))) > 0.2
    return {"straight": turns == 0 and not bends, "one-turn": turns == 1, "navigation": turns >= 2}[task]


def _random_pose(roads: RoadNetwork, before_end: float, rng: np.random.Generator) -> Pose:
    lanes = [lane for lane in roads.driveable if lane.line.length > before_end + _FROM_LANE_START + 1]
    shares = np.array([lane.line.length for lane in lanes])
    lane = lanes[int(rng.choice(len(lanes), p=shares / shares.sum()))]
    return lane.line.pose_at(float(rng.uniform(_FROM_LANE_START, lane.line.length - before_end)))


def draw_routes(roads: RoadNetwork, task: str, n: int, rng: np.random.Generator) -> list[tuple[Pose, Pose]]:
    """n random pairs of start and goal that make a task. Raises ValueError where the map is too small for it."""
    x0, y0, x1, y1 = roads.bounds
    scale = min(1.0, math.hypot(x1 - x0, y1 - y0) / 520)
    low, high = (scale * length for length in _LENGTHS[task])
    found: list[tuple[Pose, Pose]] = []
    for _ in range(200 * n):
        start, goal = _random_pose(roads, _FROM_STOP_LINE, rng), _random_pose(roads, 5.0, rng)
        try:
            route = plan_route(roads, start, goal)
        except ValueError:
            continue
        if low <= route.length <= high and _fits(route, task):
            found.append((start, goal))
            if len(found) == n:
                return found
    raise ValueError(
        f"found {len(found)} routes for {task} in {roads.name}, wanted {n}: the map is too small for this task"
    )


@lru_cache(maxsize=1)
def _fixed_routes() -> dict[str, dict[str, list[list[list[float]]]]]:
    routes: dict[str, dict[str, list[list[list[float]]]]] = json.loads(_DATA.read_text())
    return routes


def routes(town: str, task: str, seed: int = 0) -> list[tuple[Pose, Pose]]:
    """The 25 pairs of start and goal of a task; in maps that are not the package's, drawn from the seed."""
    if task not in TASKS:
        raise ValueError(f"found task {task!r}, wanted one of {', '.join(TASKS)}: type --task navigation")
    kind = "navigation" if task == "navigation-dynamic" else task
    if town in TOWNS:
        return [(Pose(*start), Pose(*goal)) for start, goal in _fixed_routes()[town][kind]]
    return draw_routes(load_roads(town), kind, ROUTES_PER_TASK, np.random.default_rng(seed))


@lru_cache(maxsize=4096)  # the same in all weathers
def _time_limit(town: str, start: Pose, goal: Pose, kind: str) -> float:
    route = plan_route(load_roads(town), start, goal)
    return route.time_limit if kind == "paper" else route.length / (5 * KMH) + 10


def task_scenarios(
    town: str,
    task: str,
    weather: int = 1,
    *,
    cars: int | None = None,
    people: int | None = None,
    seed: int = 0,
    time_limit: str = "paper",
    name: str | None = None,
) -> list[Scenario]:
    """The 25 scenarios of a task.

    cars, people: None takes the protocol's: none, and in the dynamic task 20 + 50 (town01) or 15 + 50 (town02).
    time_limit: `paper` is the path at 10 km/h, `code` the authors' path at 5 km/h plus 10 s. name: the scenarios' task,
    where it is called something else.
    """
    if time_limit not in ("paper", "code"):
        raise ValueError(f"found time limit {time_limit!r}, wanted paper or code: give time_limit='paper'")
    usual = USUAL_TRAFFIC.get(town, (20, 50)) if task == "navigation-dynamic" else (0, 0)
    n_cars, n_people = usual[0] if cars is None else cars, usual[1] if people is None else people
    found = []
    for i, (start, goal) in enumerate(routes(town, task, seed)):
        limit = _time_limit(town, start, goal, time_limit)
        found.append(Scenario(town, weather, start, goal, n_cars, n_people, limit, seed * 1000 + i, name or task))
    return found


def _draw_all() -> None:
    rng = np.random.default_rng(2018)
    drawn = {
        town: {
            task: [
                [[round(v, 3) for v in (p.x, p.y, p.heading)] for p in pair]
                for pair in draw_routes(load_roads(town), task, ROUTES_PER_TASK, rng)
            ]
            for task in _LENGTHS
        }
        for town in TOWNS
    }
    _DATA.write_text(json.dumps(drawn, indent=None, separators=(",", ":")) + "\n")


if __name__ == "__main__":
    _draw_all()
