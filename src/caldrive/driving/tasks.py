"""The four tasks of the benchmark (section 4), their routes and their scenarios: going straight, one turn, navigation,
and navigation among other cars and people.

The package's towns have 25 fixed routes for each task, in routes.json; `python -m caldrive.driving.tasks` draws those
that are missing there. On other maps routes are drawn from a seed. NoCrash has its own routes, of which 5 in town 1 are
not those of CoRL-2017's navigation.
"""

from __future__ import annotations

import json
import math
from dataclasses import astuple
from functools import lru_cache
from pathlib import Path

import numpy as np

from caldrive.datatypes import KMH, Command, Pose
from caldrive.geometry import wrap_angle
from caldrive.scenarios import TOWNS, Scenario, generated_town
from caldrive.world.roads.network import RoadNetwork
from caldrive.world.roads.route import Route, plan_route
from caldrive.world.roads.towns import load_roads

TASKS = ("straight", "one-turn", "navigation", "navigation-dynamic")
TIME_LIMITS = {  # km/h at which the path has to be driven, and s beside
    "paper": (10.0, 0.0),  # section 4
    "code": (5.0, 10.0),  # the authors' published code
    "nocrash": (5.0, 20.0),  # driving-benchmarks, `carla100`
}
ROUTES_PER_TASK = 25
USUAL_TRAFFIC = {"town01": (20, 50), "town02": (15, 50)}  # cars and people of the dynamic task
MAPS_TRAFFIC = (20, 50)  # on maps of one's own
TOWN01_ROADS = 4432.5  # m, to which the traffic of a generated town is scaled
_DATA = Path(__file__).with_name("routes.json")
# m kept between a start, or a goal, and the end of its lane, and between either and the start of its lane
_START_BEFORE_END, _GOAL_BEFORE_END, _AFTER_START = 25.0, 5.0, 6.0
# Shortest and longest route of a task in metres, for a town as large as town01; smaller ones scale with their size.
_LENGTHS = {"straight": (90.0, 300.0), "one-turn": (130.0, 420.0), "navigation": (400.0, 1000.0)}
_FULL_DIAGONAL = 520.0  # m, town01's
_MAX_BEND = 0.2  # rad between the ends of a straight route
_TRIES, _FEWEST_TRIES = 200, 1000  # for each route to draw, and in all
_NOCRASH_OWN = {"town01": 5, "town02": 0}  # routes of NoCrash that are none of the navigation's
_CUT_CORNER = 0.15  # rad, more than the first and the last metre of a lane turn


def _fits(route: Route, task: str) -> bool:
    """Whether a route has the turns of a task."""
    turns = sum(turn.command is not Command.STRAIGHT for turn in route.turns)
    bends = abs(wrap_angle(route.line.heading_at(0) - route.line.heading_at(route.length))) > _MAX_BEND
    return {"straight": turns == 0 and not bends, "one-turn": turns == 1, "navigation": turns >= 2}[task]


def _may_fit(start: Pose, goal: Pose, task: str, longest: float) -> bool:
    """Whether a route of a task, at most so many metres long, may lead from a start to a goal: quicker than to plan
    it."""
    turns = abs(wrap_angle(start.heading - goal.heading)) > _MAX_BEND + _CUT_CORNER
    return math.hypot(goal.x - start.x, goal.y - start.y) <= longest and not (task == "straight" and turns)


def _random_pose(roads: RoadNetwork, before_end: float, rng: np.random.Generator) -> Pose:
    """A place on a lane, at least so many metres before its end. Raises ValueError where all lanes are too short."""
    lanes = [lane for lane in roads.driveable if lane.line.length > before_end + _AFTER_START + 1]
    if not lanes:
        raise ValueError(
            f"found no lane in {roads.name} that is longer than {before_end + _AFTER_START + 1:.0f} m, wanted one to "
            "start on: give a larger map, or places of your own with --from and --to"
        )
    shares = np.array([lane.line.length for lane in lanes])
    lane = lanes[int(rng.choice(len(lanes), p=shares / shares.sum()))]
    return lane.line.pose_at(float(rng.uniform(_AFTER_START, lane.line.length - before_end)))


def draw_routes(roads: RoadNetwork, task: str, n: int, rng: np.random.Generator) -> list[tuple[Pose, Pose]]:
    """Random pairs of start and goal that make a task: n, or as many as a map has that is too small for so many.

    Raises ValueError where it has none.
    """
    x0, y0, x1, y1 = roads.bounds
    scale = min(1.0, math.hypot(x1 - x0, y1 - y0) / _FULL_DIAGONAL)
    low, high = (scale * length for length in _LENGTHS[task])
    pairs: list[tuple[Pose, Pose]] = []
    for _ in range(max(_FEWEST_TRIES, _TRIES * n)):
        start, goal = _random_pose(roads, _START_BEFORE_END, rng), _random_pose(roads, _GOAL_BEFORE_END, rng)
        if not _may_fit(start, goal, task, high):
            continue
        try:
            route = plan_route(roads, start, goal)
        except ValueError:
            continue
        if low <= route.length <= high and _fits(route, task):
            pairs.append((start, goal))
            if len(pairs) == n:
                return pairs
    if not pairs:
        raise ValueError(
            f"found no route for {task} in {roads.name}, wanted one: give a larger map, another --task, or places of "
            "your own with --from and --to"
        )
    return pairs


@lru_cache(maxsize=1)
def _fixed_routes() -> dict[str, dict[str, list[list[list[float]]]]]:
    routes: dict[str, dict[str, list[list[list[float]]]]] = json.loads(_DATA.read_text())
    return routes


def routes(town: str, task: str, seed: int = 0) -> list[tuple[Pose, Pose]]:
    """The 25 pairs of start and goal of a task; on maps that are not the package's, drawn from the seed, and fewer
    where there are not so many.

    Raises ValueError for an unknown task and a map that is too small for it.
    """
    if task not in (*TASKS, "nocrash"):
        raise ValueError(f"found task {task!r}, wanted one of {', '.join(TASKS)}: type --task navigation")
    kind = "navigation" if task == "navigation-dynamic" else task
    if town in TOWNS:
        return [(Pose(*start), Pose(*goal)) for start, goal in _fixed_routes()[town][kind]]
    kind = "navigation" if kind == "nocrash" else kind
    return draw_routes(load_roads(town), kind, ROUTES_PER_TASK, np.random.default_rng(seed))


def scaled_traffic(road_length: float) -> tuple[int, int]:
    """Cars and people on so many metres of streets, as dense as in town01."""
    cars, people = (round(n * road_length / TOWN01_ROADS) for n in USUAL_TRAFFIC["town01"])
    return cars, people


def usual_traffic(town: str) -> tuple[int, int]:
    """Cars and people of the dynamic task in a town."""
    if generated_town(town):
        return scaled_traffic(load_roads(town).road_length)
    return USUAL_TRAFFIC.get(town, MAPS_TRAFFIC)


@lru_cache(maxsize=4096)  # the same in all weathers
def _time_limit(town: str, start: Pose, goal: Pose, kind: str) -> float:
    """Seconds. kind: a name in TIME_LIMITS."""
    return time_limit_of(plan_route(load_roads(town), start, goal).length, kind)


def time_limit_of(length: float, kind: str) -> float:
    """Seconds for a route of a length in m. kind: a name in TIME_LIMITS. Raises ValueError for another."""
    if kind not in TIME_LIMITS:
        raise ValueError(f"found time limit {kind!r}, wanted {', '.join(TIME_LIMITS)}: type --time-limit paper")
    speed, beside = TIME_LIMITS[kind]
    return length / (speed * KMH) + beside


def task_scenarios(
    town: str,
    task: str,
    weather: int = 1,
    *,
    cars: int | None = None,
    people: int | None = None,
    seed: int = 0,
    routes_seed: int | None = None,
    time_limit: str = "paper",
    name: str | None = None,
) -> list[Scenario]:
    """The 25 scenarios of a task, fewer on a map that has not so many routes for it.

    cars, people: None takes the protocol's: none, and in the dynamic task 20 + 50 (town01) or 15 + 50 (town02); in
    generated towns as many for their roads as in town01.
    routes_seed: decides the routes on a map that is not the package's; None takes the seed.
    task: `nocrash` has that benchmark's routes. time_limit: a name in TIME_LIMITS. name: the scenarios' task,
    where it is called something else. Raises ValueError for an unknown task or time limit.
    """
    usual = usual_traffic(town) if task == "navigation-dynamic" else (0, 0)
    return [
        Scenario(
            town=town, weather=weather, start=start, goal=goal, n_vehicles=usual[0] if cars is None else cars,
            n_pedestrians=usual[1] if people is None else people, time_limit=_time_limit(town, start, goal, time_limit),
            seed=seed * 1000 + i, task=name or task,
        )
        for i, (start, goal) in enumerate(routes(town, task, seed if routes_seed is None else routes_seed))
    ]  # fmt: skip


def _drawn(town: str, task: str, n: int, rng: np.random.Generator) -> list[list[list[float]]]:
    """Random routes as in the file."""
    pairs = draw_routes(load_roads(town), task, n, rng) if n else []
    return [[[round(value, 3) for value in astuple(pose)] for pose in pair] for pair in pairs]


def _draw_missing() -> None:
    """Draws the fixed routes that the file lacks; those that it has were drawn when the towns were made, and stay."""
    drawn = json.loads(_DATA.read_text())
    for town in TOWNS:
        of_town = drawn.setdefault(town, {})
        for number, task in enumerate(_LENGTHS):
            if task not in of_town:
                of_town[task] = _drawn(town, task, ROUTES_PER_TASK, np.random.default_rng([2018, number]))
        own = _drawn(town, "navigation", _NOCRASH_OWN[town], np.random.default_rng(2019))
        of_town.setdefault("nocrash", of_town["navigation"][: ROUTES_PER_TASK - len(own)] + own)
    _DATA.write_text(json.dumps(drawn, indent=None, separators=(",", ":")) + "\n")


if __name__ == "__main__":
    _draw_missing()
