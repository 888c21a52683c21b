"""Routes: the line runs along the lanes from start to goal, and commands come in time for each junction."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import networkx as nx
import numpy as np
import pytest

from caldrive.agents.cal import CALAgent, OraclePerception
from caldrive.control.controller import CALController
from caldrive.datatypes import Command, Pose
from caldrive.driving.rollout import run_episode
from caldrive.geometry import Polyline, moved, wrap_angle
from caldrive.results import Outcome
from caldrive.scenarios import Scenario
from caldrive.world.embedded import EmbeddedWorld
from caldrive.world.roads.network import Lane, RoadNetwork
from caldrive.world.roads.route import COMMAND_AHEAD, Route, follow_lanes, plan_route, random_route
from caldrive.world.roads.towns import load_roads
from tests.maps import lane, lanes, link, road, straight, write_roads

needs_netconvert = pytest.mark.skipif(
    not pytest.importorskip("importlib.util").find_spec("sumo"), reason="netconvert comes with the extra opendrive"
)
SIDES = {Command.LEFT: 1, Command.RIGHT: -1, Command.STRAIGHT: 0}


def random_pose(roads: RoadNetwork, rng: np.random.Generator) -> Pose:
    lane = roads.driveable[int(rng.integers(len(roads.driveable)))]
    return lane.line.pose_at(float(rng.uniform(0.5, lane.line.length - 0.5)))


def some_routes(roads: RoadNetwork, n: int, seed: int = 0) -> list[tuple[Pose, Pose, Route]]:
    rng = np.random.default_rng(seed)
    pairs = [(random_pose(roads, rng), random_pose(roads, rng)) for _ in range(n)]
    return [(start, goal, plan_route(roads, start, goal)) for start, goal in pairs]


def before_a_junction(roads: RoadNetwork, metres: float) -> Pose:
    """A pose that far before a stop line of town01 which lies at the end of a long street."""
    lane = next(roads.lanes[post.lane] for post in roads.posts if roads.lanes[post.lane].line.length > metres)
    return lane.line.pose_at(lane.line.length - metres)


def test_a_route_begins_at_the_start_and_has_its_goal_at_its_length(town: RoadNetwork) -> None:
    for start, goal, route in some_routes(town, 30):
        first, last = route.line.pose_at(0.0), route.line.pose_at(route.length)
        assert math.hypot(first.x - start.x, first.y - start.y) < 0.05
        assert math.hypot(last.x - goal.x, last.y - goal.y) < 0.3
        assert abs(wrap_angle(last.heading - goal.heading)) < 0.1


def test_a_route_goes_on_behind_its_goal(town: RoadNetwork) -> None:
    assert all(route.line.length > route.length + 30 for _, _, route in some_routes(town, 30))


def test_a_start_beside_the_centre_line_gives_the_route_along_it(town01: RoadNetwork) -> None:
    lane = max(town01.driveable, key=lambda lane: lane.line.length)
    start, goal = lane.line.pose_at(5.0), lane.line.pose_at(25.0)
    route = plan_route(town01, moved(start, left=1.0, turn=0.3), goal)
    assert route.length == pytest.approx(20.0, abs=0.1)
    assert route.turns == ()


def test_a_goal_behind_the_start_on_the_same_lane_takes_a_way_around(town01: RoadNetwork) -> None:
    lane = max(town01.driveable, key=lambda lane: lane.line.length)
    route = plan_route(town01, lane.line.pose_at(25.0), lane.line.pose_at(5.0))
    assert route.length > 200
    assert route.lanes[0][0] == lane.id


def test_the_line_of_a_route_neither_jumps_nor_kinks(town: RoadNetwork) -> None:
    for _, _, route in some_routes(town, 30):
        headings = [route.line.heading_at(s) for s in np.arange(0, route.line.length, 0.5)]
        poses = [route.line.pose_at(s) for s in np.arange(0, route.line.length, 0.5)]
        assert max(abs(wrap_angle(b - a)) for a, b in pairwise(headings)) < math.radians(12)
        assert max(math.hypot(b.x - a.x, b.y - a.y) for a, b in pairwise(poses)) < 0.51


def test_the_lanes_of_a_route_stand_where_the_line_meets_them(town: RoadNetwork) -> None:
    for _, _, route in some_routes(town, 10):
        for name, begin in route.lanes[1:]:
            first = town.lanes[name].line.points[0]
            at = route.line.pose_at(begin)
            assert math.hypot(at.x - first[0], at.y - first[1]) < 0.5


def test_a_turn_bends_the_line_to_its_side(town: RoadNetwork) -> None:
    seen = set()
    for _, _, route in some_routes(town, 40):
        for turn in route.turns:
            bend = wrap_angle(route.line.heading_at(turn.end + 1) - route.line.heading_at(turn.start - 1))
            assert bend == pytest.approx(SIDES[turn.command] * math.pi / 2, abs=0.25)
            seen.add(turn.command)
    assert seen == set(Command)


def test_a_turn_lies_inside_a_junction(town: RoadNetwork) -> None:
    ends = {town.lanes[post.lane].line.points[-1].round(1).tobytes() for post in town.posts}
    for _, _, route in some_routes(town, 10):
        for turn in route.turns:
            at = route.line.pose_at(turn.start)
            stop = min(np.hypot(*(np.frombuffer(end) - (at.x, at.y))) for end in ends)
            assert stop < 0.5 or turn.start <= 0
            assert 5 < turn.end - turn.start < 40


def test_a_command_comes_20_m_before_its_junction_and_ends_with_it(town: RoadNetwork) -> None:
    for _, _, route in some_routes(town, 30):
        for turn, after in zip(route.turns, [*route.turns[1:], None], strict=False):
            assert route.command_at(turn.start - COMMAND_AHEAD + 0.01) is turn.command
            assert route.command_at((turn.start + turn.end) / 2) is turn.command
            assert route.command_at(turn.end - 0.01) is turn.command
            if after is None or after.start - COMMAND_AHEAD > turn.end + 0.02:
                assert route.command_at(turn.end + 0.01) is Command.STRAIGHT


def test_a_junction_is_where_its_turn_is(town: RoadNetwork) -> None:
    for _, _, route in some_routes(town, 10):
        for turn in route.turns:
            assert route.inside_junction((turn.start + turn.end) / 2)
        outside = [s for s in np.arange(0.0, route.length, 3.0) if not any(t.start <= s <= t.end for t in route.turns)]
        assert outside
        assert not any(map(route.inside_junction, outside))


def test_before_the_first_command_the_command_is_straight(town01: RoadNetwork) -> None:
    for _, _, route in some_routes(town01, 20):
        if route.turns and route.turns[0].start > COMMAND_AHEAD + 1:
            assert route.command_at(route.turns[0].start - COMMAND_AHEAD - 0.01) is Command.STRAIGHT
            assert route.command_at(0.0) is Command.STRAIGHT


def test_a_route_has_time_at_10_kmh(town01: RoadNetwork) -> None:
    route = Route(plan_route(town01, *some_routes(town01, 1)[0][:2]).line, length=100.0, turns=(), lanes=())
    assert route.time_limit == pytest.approx(36.0)


def test_no_way_through_the_lanes_is_shorter_than_the_route(town: RoadNetwork) -> None:
    graph = nx.DiGraph()
    for each in town.lanes.values():
        for successor in each.successors:
            graph.add_edge(each.id, successor, length=each.line.length)
    for start, goal, route in some_routes(town, 30, seed=1):
        (first, s), (last, end) = town.lane_at(start), town.lane_at(goal)
        if first.id == last.id:
            continue
        shortest = nx.dijkstra_path_length(graph, first.id, last.id, weight="length") - s + end
        assert route.length == pytest.approx(shortest, abs=0.1)


@pytest.mark.parametrize("off", [Pose(-500, 0, 0), Pose(200, 200, 0)])
def test_a_start_or_goal_off_the_road_is_refused(off: Pose, town01: RoadNetwork) -> None:
    on = town01.driveable[0].line.pose_at(1.0)
    for start, goal in ((off, on), (on, off)):
        with pytest.raises(ValueError, match="found no lane of town01"):
            plan_route(town01, start, goal)


def test_a_goal_that_no_lane_leads_to_is_refused(town01: RoadNetwork) -> None:
    first, last = town01.driveable[0], town01.driveable[-1]
    cut = replace(town01, lanes=dict(town01.lanes) | {first.id: replace(first, successors=())})
    with pytest.raises(ValueError, match="found no way from"):
        plan_route(cut, first.line.pose_at(1.0), last.line.pose_at(1.0))


@pytest.mark.parametrize("length", [50.0, 400.0, 1500.0])
def test_a_random_route_is_as_long_as_asked(length: float, town: RoadNetwork) -> None:
    start = town.driveable[0].line.pose_at(1.0)
    for seed in range(5):
        route = random_route(town, start, length, np.random.default_rng(seed))
        assert length <= route.length < length + 400
        assert route.line.pose_at(0.0).x == pytest.approx(start.x, abs=0.05)


def test_random_routes_take_every_turn_and_equal_seeds_equal_ones(town01: RoadNetwork) -> None:
    start = before_a_junction(town01, 10.0)
    routes = [random_route(town01, start, 100.0, np.random.default_rng(seed)) for seed in range(20)]
    assert len({route.turns[0].command for route in routes}) == 2
    again = random_route(town01, start, 100.0, np.random.default_rng(7))
    assert np.array_equal(again.line.points, routes[7].line.points)


def test_a_random_route_ends_outside_a_junction(town01: RoadNetwork) -> None:
    for seed in range(20):
        route = random_route(town01, before_a_junction(town01, 5.0), 30.0, np.random.default_rng(seed))
        end = route.line.pose_at(route.length - 0.1)
        assert town01.lane_at(end)[0].id in {name for name, _ in route.lanes}
        assert all(turn.end < route.length for turn in route.turns)


def test_a_goal_on_a_lane_that_joins_nothing_cannot_be_reached(town01: RoadNetwork) -> None:
    start = max(town01.driveable, key=lambda lane: lane.line.length)
    line = Polyline(np.array([(-900.0, -900.0), (-800.0, -900.0)]))
    island = replace(start, id="island_0", line=line, successors=())
    roads = replace(town01, lanes=town01.lanes | {island.id: island})
    with pytest.raises(ValueError, match=r"found no way from .* to \(-850, -900\)"):
        plan_route(roads, start.line.pose_at(5.0), line.pose_at(50.0))


def test_a_way_too_short_to_follow_is_refused_in_a_sentence(town02: RoadNetwork) -> None:
    stub = Lane("stub_0", Polyline(np.array([(0.0, 0.0), (0.01, 0.0)])), width=4.0, limit=50.0)
    roads = replace(town02, lanes={"stub_0": stub})
    with pytest.raises(ValueError, match=r"found a way of 0\.01 m in town02 .*wanted a longer one"):
        follow_lanes(roads, ["stub_0"], 0.0, 0.01)


def write_forced_change(folder: Path) -> Path:
    """Road 1 of two lanes, of which the left one goes on as road 2."""
    pair, right = lanes(lane(-1, link=". -1") + lane(-2)), lanes(lane(-1, link="-1 ."))
    return write_roads(
        folder,
        road(1, straight(0, 0, 0, 200), pair, link("successor", "road", 2, "start")),
        road(2, straight(200, 0, 0, 200), right, link("predecessor", "road", 1, "end")),
    )


@needs_netconvert
def test_a_route_changes_lanes_where_no_other_way_leads_to_the_goal(tmp_path: Path) -> None:
    roads = load_roads(str(write_forced_change(tmp_path)))
    start, goal = Pose(20, -6, 0), Pose(350, -2, 0)
    route = plan_route(roads, start, goal)
    (change,) = route.changes
    assert change.to_left
    assert 20 < change.start < change.end < 180
    assert route.length == pytest.approx(330, abs=1)
    left = [route.line.points_at(np.array([s]))[0, 1] for s in (0, change.start, change.end, route.length)]
    assert left == pytest.approx([-6, -6, -2, -2], abs=0.05)
    assert route.line.length == pytest.approx(380, abs=2)
    assert max(abs(route.line.heading_at(float(s))) for s in range(0, 330, 2)) < math.radians(12), "a smooth step"
    assert [name for name, _ in route.lanes][:2] == ["-1_0", "-1_1"]


@needs_netconvert
def test_a_route_that_needs_no_change_has_none(tmp_path: Path) -> None:
    roads = load_roads(str(write_forced_change(tmp_path)))
    assert plan_route(roads, Pose(20, -2, 0), Pose(350, -2, 0)).changes == ()


@needs_netconvert
@pytest.mark.parametrize(("start", "goal"), [(185, 350), (60, 70)], ids=["too late", "too near"])
def test_without_room_for_a_change_there_is_no_way(start: float, goal: float, tmp_path: Path) -> None:
    roads = load_roads(str(write_forced_change(tmp_path)))
    with pytest.raises(ValueError, match="found no way from"):
        plan_route(roads, Pose(start, -6, 0), Pose(goal, -2, 0))


@needs_netconvert
def test_a_goal_on_the_lane_beside_is_reached_by_a_change(tmp_path: Path) -> None:
    roads = load_roads(str(write_forced_change(tmp_path)))
    for (y, z), to_left in (((-6, -2), True), ((-2, -6), False)):
        route = plan_route(roads, Pose(20, y, 0), Pose(120, z, 0))
        assert [change.to_left for change in route.changes] == [to_left]
        assert (route.length, route.line.pose_at(route.length).y) == pytest.approx((100, z), abs=0.3)
        assert route.changes[0].end < route.length


@needs_netconvert
def test_the_oracle_changes_lanes_and_arrives(tmp_path: Path) -> None:
    path = str(write_forced_change(tmp_path))
    world = EmbeddedWorld()
    agent = CALAgent(OraclePerception(world.truth), CALController())
    scenario = Scenario(town=path, weather=1, start=Pose(20, -6, 0), goal=Pose(350, -2, 0), time_limit=90.0)
    result = run_episode(world, agent, scenario)
    world.close()
    assert (result.outcome, result.infractions) == (Outcome.SUCCESS, ())
