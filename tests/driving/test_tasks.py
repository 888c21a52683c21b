"""The four tasks: fixed routes that fit their task's definition, and the scenarios made of them."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from caldrive.datatypes import Command
from caldrive.driving.tasks import ROUTES_PER_TASK, TASKS, draw_routes, routes, task_scenarios
from caldrive.geometry import wrap_angle
from caldrive.scenarios import TOWNS
from caldrive.world.roads.network import RoadNetwork
from caldrive.world.roads.route import Route, plan_route
from caldrive.world.roads.towns import load_roads

LENGTHS = {  # shortest and longest route in m
    ("town01", "straight"): (90, 300), ("town01", "one-turn"): (130, 420), ("town01", "navigation"): (400, 1000),
    ("town02", "straight"): (45, 175), ("town02", "one-turn"): (65, 240), ("town02", "navigation"): (200, 600),
}  # fmt: skip


def planned(town: str, task: str) -> list[Route]:
    return [plan_route(load_roads(town), start, goal) for start, goal in routes(town, task)]


def turns(route: Route) -> list[Command]:
    return [turn.command for turn in route.turns if turn.command is not Command.STRAIGHT]


@pytest.mark.parametrize("town", TOWNS)
@pytest.mark.parametrize("task", TASKS)
def test_a_task_has_25_different_routes(town: str, task: str) -> None:
    assert len(set(routes(town, task))) == ROUTES_PER_TASK == 25


@pytest.mark.parametrize("town", TOWNS)
def test_straight_routes_neither_turn_nor_bend(town: str) -> None:
    for route in planned(town, "straight"):
        assert turns(route) == []
        assert abs(wrap_angle(route.line.heading_at(0) - route.line.heading_at(route.length))) < 0.2


@pytest.mark.parametrize("town", TOWNS)
def test_one_turn_routes_turn_once_and_to_both_sides(town: str) -> None:
    commands = [turns(route) for route in planned(town, "one-turn")]
    assert {len(of_route) for of_route in commands} == {1}
    assert {of_route[0] for of_route in commands} == {Command.LEFT, Command.RIGHT}


@pytest.mark.parametrize("town", TOWNS)
def test_navigation_routes_turn_twice_or_more(town: str) -> None:
    assert min(len(turns(route)) for route in planned(town, "navigation")) >= 2


@pytest.mark.parametrize(("town", "task"), LENGTHS)
def test_routes_are_as_long_as_their_task_asks(town: str, task: str) -> None:
    low, high = LENGTHS[town, task]
    assert all(low <= route.length <= high for route in planned(town, task))


@pytest.mark.parametrize("town", TOWNS)
def test_the_dynamic_task_has_the_routes_of_navigation(town: str) -> None:
    assert routes(town, "navigation-dynamic") == routes(town, "navigation")


@pytest.mark.parametrize("town", TOWNS)
@pytest.mark.parametrize("task", TASKS)
def test_nobody_starts_right_before_a_stop_line(town: str, task: str) -> None:
    roads = load_roads(town)
    for start, _ in routes(town, task):
        lane, s = roads.lane_at(start)
        assert lane.line.length - s > 24


def test_the_routes_do_not_depend_on_the_seed() -> None:
    assert routes("town01", "straight", seed=1) == routes("town01", "straight", seed=2)


@pytest.mark.parametrize(("town", "others"), [("town01", (20, 50)), ("town02", (15, 50))])
def test_only_the_dynamic_task_has_others_on_the_road(town: str, others: tuple[int, int]) -> None:
    for task in TASKS:
        wanted = others if task == "navigation-dynamic" else (0, 0)
        assert {(scenario.n_vehicles, scenario.n_pedestrians) for scenario in task_scenarios(town, task)} == {wanted}


def test_others_can_be_asked_for_and_left_out() -> None:
    assert {
        (scenario.n_vehicles, scenario.n_pedestrians)
        for scenario in task_scenarios("town02", "straight", cars=70, people=150)
    } == {(70, 150)}
    assert {scenario.n_vehicles for scenario in task_scenarios("town02", "navigation-dynamic", cars=0)} == {0}


def test_scenarios_carry_task_weather_and_their_own_seed() -> None:
    one_turn = task_scenarios("town02", "one-turn", 14, seed=3)
    assert {(scenario.town, scenario.task, scenario.weather) for scenario in one_turn} == {("town02", "one-turn", 14)}
    assert len({scenario.seed for scenario in one_turn}) == 25
    assert {scenario.seed for scenario in one_turn}.isdisjoint(
        scenario.seed for scenario in task_scenarios("town02", "one-turn", 14, seed=4)
    )


def test_the_time_limit_is_that_of_the_paper_or_that_of_its_code() -> None:
    lengths = [route.length for route in planned("town02", "straight")]
    paper, code = (task_scenarios("town02", "straight", time_limit=limit) for limit in ("paper", "code"))
    assert [scenario.time_limit for scenario in paper] == pytest.approx([length * 0.36 for length in lengths])
    assert [scenario.time_limit for scenario in code] == pytest.approx([length * 0.72 + 10 for length in lengths])


def test_an_unknown_task_names_the_known_ones() -> None:
    with pytest.raises(ValueError, match="found task 'parking', wanted one of straight, one-turn, navigation"):
        task_scenarios("town01", "parking")


def test_an_unknown_time_limit_is_refused() -> None:
    with pytest.raises(ValueError, match="found time limit 'none', wanted paper, code, nocrash"):
        task_scenarios("town02", "straight", time_limit="none")


@pytest.mark.parametrize("task", ["straight", "one-turn", "navigation"])
def test_routes_drawn_anew_fit_their_task_and_follow_the_seed(task: str, town02: RoadNetwork) -> None:
    first, again, other = (draw_routes(town02, task, 5, np.random.default_rng(seed)) for seed in (1, 1, 2))
    assert first == again != other
    counts = [len(turns(plan_route(town02, *pair))) for pair in first]
    low, high = {"straight": (0, 0), "one-turn": (1, 1), "navigation": (2, math.inf)}[task]
    assert all(low <= count <= high for count in counts)


def test_a_map_with_fewer_routes_gives_those_that_it_has(town02: RoadNetwork, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("caldrive.driving.tasks._TRIES", 8)
    found = draw_routes(town02, "straight", 25, np.random.default_rng(0))
    assert 0 < len(found) < 25


def test_a_map_of_short_lanes_has_no_place_to_start(town02: RoadNetwork) -> None:
    lane = min(town02.driveable, key=lambda lane: lane.line.length)
    small = replace(town02, lanes={lane.id: replace(lane, successors=())})
    with pytest.raises(ValueError, match=r"found no lane in town02 that is longer than 32 m, wanted one to start on"):
        draw_routes(small, "straight", 1, np.random.default_rng(0))


def test_a_map_too_small_for_a_task_says_so(town02: RoadNetwork) -> None:
    (lane,) = [lane for lane in town02.driveable if lane.line.length > 60][:1]
    small = replace(town02, lanes={lane.id: replace(lane, successors=())})
    with pytest.raises(ValueError, match="found no route for navigation in town02, wanted one: give a larger map"):
        draw_routes(small, "navigation", 3, np.random.default_rng(0))
