"""Where to drive: an A* plan over the lanes, the line to follow and each junction's command (supplement 2.2).

A route stays in its lane; it changes lanes only where no other way leads to the goal.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise

import networkx as nx
import numpy as np

from caldrive.datatypes import KMH, Command, Points, Pose
from caldrive.geometry import Polyline, added_up
from caldrive.world.roads.lane_changes import CHANGE_ROOM, LaneChange, across, middles_of_changes, stretches_of
from caldrive.world.roads.network import Lane, RoadNetwork

COMMAND_AHEAD = 20.0  # m before a junction from which its command is given
BEYOND_GOAL = 60.0  # m that the line goes on, so that labels near the goal look like labels anywhere
CLOSEST = 0.05  # m between two points of a line
CHANGE_COST = 100.0  # m of way that are rather driven than a lane changed
PLANNED_SPEED = 10 * KMH  # the pace that sets the time limit (section 4)


@dataclass(frozen=True)
class Turn:
    """A junction on the route."""

    start: float
    """m along the route."""
    end: float
    """m along the route."""
    command: Command


@dataclass(frozen=True)
class Route:
    """A line of lane centres to follow."""

    line: Polyline
    """It goes on beyond the goal."""
    length: float
    """m along the line to the goal."""
    turns: tuple[Turn, ...]
    """The junctions up to the goal."""
    lanes: tuple[tuple[str, float], ...]
    """Ids, and where along the line each lane begins (m; the first one's begin lies before it)."""
    changes: tuple[LaneChange, ...] = ()
    """From lane to lane, up to the goal."""

    def command_at(self, s: float) -> Command:
        """Straight by default; a junction's command from 20 m before it until it is left behind."""
        for turn in self.turns:
            if turn.start - COMMAND_AHEAD <= s <= turn.end:
                return turn.command
        return Command.STRAIGHT

    def inside_junction(self, s: float) -> bool:
        """Whether this place lies in a junction, whatever the command."""
        return any(turn.start <= s <= turn.end for turn in self.turns)

    @property
    def way(self) -> Points:
        """The points (N, 2) of the line up to the goal, m."""
        end = self.line.pose_at(self.length)
        return np.vstack((self.line.points[self.line.s < self.length], [(end.x, end.y)]))

    @property
    def time_limit(self) -> float:
        """Seconds to drive the route at 10 km/h (section 4)."""
        return self.length / PLANNED_SPEED


@lru_cache(maxsize=8)
def _graph(roads: RoadNetwork, changes: bool) -> nx.DiGraph:
    """Lanes as nodes; an edge is as long as the lane that it leaves. changes: whether lanes side by side are joined."""
    graph = nx.DiGraph()
    graph.add_nodes_from(roads.lanes)  # also those that join no other
    for lane in roads.lanes.values():
        for successor in lane.successors:
            graph.add_edge(lane.id, successor, length=lane.line.length)
        if changes and lane.line.length > CHANGE_ROOM:
            for other in roads.beside(lane):
                graph.add_edge(lane.id, other, length=CHANGE_COST)
    return graph


def _turns(roads: RoadNetwork, lanes: list[tuple[str, float]]) -> tuple[Turn, ...]:
    """Consecutive internal lanes of one junction are one turn."""
    turns: list[Turn] = []
    for lane_id, start in lanes:
        lane = roads.lanes[lane_id]
        end = start + lane.line.length
        if lane.turn is not None:
            turns.append(Turn(start, end, lane.turn))
        elif lane.internal and turns and abs(turns[-1].end - start) < 0.1:
            turns[-1] = Turn(turns[-1].start, end, turns[-1].command)
    return tuple(turns)


def _onward(roads: RoadNetwork, lane: Lane) -> Lane | None:
    """The straightest successor, None where the road ends."""
    end = lane.line.heading_at(lane.line.length)

    def straightness(successor: Lane) -> float:
        return math.cos(successor.line.heading_at(successor.line.length) - end)

    return max((roads.lanes[id] for id in lane.successors), key=straightness, default=None)


def _thinned(points: Points) -> Points:
    """Without points on top of the one before: where lanes meet, maps are off by millimetres, also backwards."""
    kept = [points[0]]
    for point in points[1:]:
        if abs(point[0] - kept[-1][0]) + abs(point[1] - kept[-1][1]) > CLOSEST:
            kept.append(point)
    return np.array(kept)


def follow_lanes(roads: RoadNetwork, ids: list[str], start: float, end: float) -> Route:
    """The route along lanes, each connected to the one before it or beside it, from `start` m on the first to `end` m
    on the last. Raises ValueError where they are all but one place."""
    driven = stretches_of(roads, ids)
    begin = start * (driven[0][-1].line.length / driven[0][0].line.length)  # on the lane that it changes to
    length = added_up(stretch[-1].line.length for stretch in driven[:-1]) - begin + end
    reached = length + driven[-1][-1].line.length - end
    stretches = [*driven, *_beyond(roads, driven[-1][-1], reached, length + BEYOND_GOAL)]
    begins = np.cumsum([-begin] + [stretch[-1].line.length for stretch in stretches[:-1]]).tolist()
    lines, changes = [], list[LaneChange]()
    for k, (stretch, at) in enumerate(zip(stretches, begins, strict=True)):
        low, high = start if k == 0 else 0.0, end if k == len(driven) - 1 else stretch[-1].line.length
        middles = middles_of_changes(len(stretch) - 1, low, high)
        lines.append(across(stretch, middles, low) if middles else _along(stretch[0], low if k == 0 else None))
        changes += [
            LaneChange(at + middle - half, at + middle + half, roads.is_left_of(b, a))
            for (middle, half), (a, b) in zip(middles, pairwise(stretch), strict=True)
        ]
    lanes = [(lane.id, at) for stretch, at in zip(stretches, begins, strict=True) for lane in stretch]
    inside = [turn for turn in _turns(roads, lanes) if turn.start < length]
    line = _thinned(np.concatenate(lines))
    if len(line) < 2:
        raise ValueError(
            f"found a way of {length:.2f} m in {roads.name} where the road ends, wanted a longer one: "
            "give a start and a goal farther apart, or another map"
        )
    return Route(Polyline(line), length, turns=tuple(inside), lanes=tuple(lanes), changes=tuple(changes))


def _beyond(roads: RoadNetwork, lane: Lane, reached: float, wanted: float) -> Iterator[list[Lane]]:
    """The lanes after one, straight on, from so many metres of a route up to those wanted."""
    while reached < wanted and (following := _onward(roads, lane)) is not None:
        yield [following]
        reached += following.line.length
        lane = following


def _along(lane: Lane, start: float | None) -> Points:
    """Points (N, 2) of a lane, from a place on it (m) on."""
    if start is None:
        return lane.line.points
    here = lane.line.pose_at(start)
    return np.concatenate(([(here.x, here.y)], lane.line.points[lane.line.s > start + 0.01]))


def plan_route(roads: RoadNetwork, start: Pose, goal: Pose) -> Route:
    """The shortest route by A*, without lane changes if there is one. Raises ValueError where start or goal is off the
    road or cannot be reached."""
    (first, s), (last, end) = roads.lane_at(start), roads.lane_at(goal)
    if first.id == last.id and end > s:
        return follow_lanes(roads, [first.id], s, end)
    for changes in (False, True):
        graph = _graph(roads, changes)
        if changes and end < CHANGE_ROOM:  # too late to change to the last lane
            graph = nx.restricted_view(graph, [], [(other, last.id) for other in roads.beside(last)])
        ways = [_shortest(roads, graph, way, last) for way in first.successors]
        if changes and (end if last.id in roads.beside(first) else first.line.length) - s > CHANGE_ROOM:
            ways += [_shortest(roads, graph, way, last) for way in roads.beside(first)]
        if found := [ids for ids in ways if ids]:
            return follow_lanes(roads, [first.id, *min(found, key=lambda ids: _cost(roads, ids))], s, end)
    raise ValueError(
        f"found no way from ({start.x:.0f}, {start.y:.0f}) to ({goal.x:.0f}, {goal.y:.0f}) in {roads.name}: "
        "give a goal that lanes lead to"
    )


def _shortest(roads: RoadNetwork, graph: nx.DiGraph, first: str, last: Lane) -> list[str]:
    """Ids of the lanes from one to another by A*, empty where none lead there."""
    target = last.line.pose_at(0)

    def beeline(node: str, _: str) -> float:
        here = roads.lanes[node].line.pose_at(0)
        return math.hypot(here.x - target.x, here.y - target.y)

    try:
        return list(nx.astar_path(graph, first, last.id, heuristic=beeline, weight="length"))
    except nx.NetworkXException:
        return []


def _cost(roads: RoadNetwork, ids: list[str]) -> float:
    """m of a way, with what its lane changes count for."""
    stretches = stretches_of(roads, ids)
    length = added_up(stretch[-1].line.length for stretch in stretches)
    return length + CHANGE_COST * (len(ids) - len(stretches))


def random_route(
    roads: RoadNetwork, start: Pose, length: float, rng: np.random.Generator, through: str | None = None
) -> Route:
    """A route of about a length that takes a random turn at every junction (section 3.1, data collection).

    through: a lane that it takes wherever it can.
    """
    lane, s = roads.lane_at(start)
    ids, reached = [lane.id], lane.line.length - s
    while reached < length or roads.lanes[ids[-1]].internal:
        successors = roads.lanes[ids[-1]].successors
        if not successors:
            break
        ids.append(through if through in successors else successors[int(rng.integers(len(successors)))])
        reached += roads.lanes[ids[-1]].line.length
    return follow_lanes(roads, ids, s, roads.lanes[ids[-1]].line.length)
