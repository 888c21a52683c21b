"""Which episodes a command drives: some of a task's routes, or a way between two places of one's own."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

from caldrive.checks import MOST_SEED, require_within
from caldrive.datatypes import KMH, Pose
from caldrive.driving.settings import EpisodeSettings
from caldrive.driving.setup import planned_town
from caldrive.driving.tasks import task_scenarios
from caldrive.scenarios import Scenario

if TYPE_CHECKING:
    from caldrive.world.roads.network import RoadNetwork

OWN_TASK = "own"
SLOW, SPARE = 5 * KMH, 20.0  # m/s and s: the time limit where a world's map is not known, along the beeline


def chosen_scenarios(settings: EpisodeSettings, n: int) -> list[Scenario]:
    """n of the task's scenarios, from settings.route on, or the way from settings.start to settings.goal.

    Raises ValueError for numbers that cannot be, and for places away from any lane.
    """
    _check(settings, n)
    settings = replace(settings, town=planned_town(settings, settings.town))
    chosen = [_own_scenario(settings)] * n if settings.start or settings.goal else _of_task(settings, n)
    if settings.seconds is None:
        return chosen
    return [replace(scenario, time_limit=min(scenario.time_limit, settings.seconds)) for scenario in chosen]


def _check(settings: EpisodeSettings, n: int) -> None:
    for option, number in (("--cars", settings.cars), ("--people", settings.people)):
        if number is not None:
            require_within(option, number, 0, math.inf, 0)
    require_within("--episodes", n, 1, 100_000, 1)
    require_within("--seed", settings.seed, 0, MOST_SEED, 0)
    if settings.seconds is not None:
        require_within("--seconds", settings.seconds, 0.1, math.inf, 60)
    if bool(settings.start) != bool(settings.goal) or (not settings.is_mapped and not settings.start):
        places = [
            f"{option} {place}" for option, place in (("--from", settings.start), ("--to", settings.goal)) if place
        ]
        raise ValueError(
            f"found {places[0] if places else 'neither --from nor --to'}, wanted a start and a goal: "
            "type --from X,Y --to X,Y (caldrive town --plan FILE.png draws a map to choose from)"
        )


def _of_task(settings: EpisodeSettings, n: int) -> list[Scenario]:
    of_task = task_scenarios(
        settings.town, settings.task, settings.weather, cars=settings.cars, people=settings.people, seed=settings.seed
    )
    require_within("--route", settings.route, 0, len(of_task) - 1, 0)
    return [of_task[(settings.route + k) % len(of_task)] for k in range(n)]


def parse_place(text: str, option: str) -> tuple[float, float, float | None]:
    """x and y in m, and the heading in rad where one is given (in degrees). Raises ValueError for another text."""
    try:
        numbers = [float(part) for part in text.split(",")]
        if len(numbers) not in (2, 3) or not all(map(math.isfinite, numbers)):
            raise ValueError
    except ValueError as error:
        raise ValueError(
            f"found {option} {text}, wanted X,Y or X,Y,HEADING in metres and degrees: type {option} 130,45 or "
            f"{option} 130,45,90"
        ) from error
    x, y, *heading = numbers
    return x, y, math.radians(heading[0]) if heading else None


def _own_scenario(settings: EpisodeSettings) -> Scenario:
    """The way between two places; without a heading a place takes that of its nearest lane."""
    assert settings.start is not None
    assert settings.goal is not None
    begin, end = parse_place(settings.start, "--from"), parse_place(settings.goal, "--to")
    if settings.is_mapped:
        start, goal, limit = _on_map(settings.town, begin, end)
    else:
        start, goal, limit = _beeline(begin, end)
    return Scenario(
        town=settings.town, weather=settings.weather, start=start, goal=goal, n_vehicles=settings.cars or 0,
        n_pedestrians=settings.people or 0, time_limit=limit, seed=settings.seed, task=OWN_TASK,
    )  # fmt: skip


def _on_map(
    town: str, begin: tuple[float, float, float | None], end: tuple[float, float, float | None]
) -> tuple[Pose, Pose, float]:
    from caldrive.world.roads.route import plan_route
    from caldrive.world.roads.towns import load_roads

    roads = load_roads(town)
    start, goal = _on_lane(roads, *begin), _on_lane(roads, *end)
    return start, goal, plan_route(roads, start, goal).time_limit


def _on_lane(roads: RoadNetwork, x: float, y: float, heading: float | None) -> Pose:
    """The middle of the lane at a place. Raises ValueError where there is none, and names the nearest."""
    lane, s = roads.lane_at(Pose(x, y, roads.nearest_heading(x, y) if heading is None else heading))
    return lane.line.pose_at(s)


def _beeline(
    begin: tuple[float, float, float | None], end: tuple[float, float, float | None]
) -> tuple[Pose, Pose, float]:
    """Start, goal and a generous time limit where nothing is known of the ways between them."""
    (x, y, heading), (u, v, _) = begin, end
    ahead = math.atan2(v - y, u - x)
    start = Pose(x, y, ahead if heading is None else heading)
    return start, Pose(u, v, ahead), math.hypot(u - x, v - y) / SLOW + SPARE
