"""Where to drive: an A* plan over the lanes, the line to follow and each junction's command (supplement 2.2)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import networkx as nx
import numpy as np

from caldrive.datatypes import KMH, Command, Points, Pose
from caldrive.geometry import Polyline
from caldrive.world.roads.network import Lane, RoadNetwork

COMMAND_AHEAD = 20.0  # m before a junction from which its command is given
BEYOND_GOAL = 60.0  # m that the line goes on, so that labels near the goal look like labels anywhere
CLOSEST = 0.05  # m between two points of a line
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
    def time_limit(self) -> float:
        """Seconds to drive the route at 10 km/h (section 4)."""
        return self.length / PLANNED_SPEED


@lru_cache(maxsize=8)
def _graph(roads: RoadNetwork) -> nx.DiGraph:
    """Lanes as nodes; an edge is as long as the lane that it leaves."""
    graph = nx.DiGraph()
    graph.add_nodes_from(roads.lanes)  # also those that join no other
    for lane in roads.lanes.values():
        for successor in lane.successors:
            graph.add_edge(lane.id, successor, length=lane.line.length)
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
    """The route along connected lanes from `start` m on the first to `end` m on the last. Raises ValueError where they
    are all but one place."""
    path = [roads.lanes[id] for id in ids]
    first = path[0]
    length = sum(lane.line.length for lane in path[:-1]) - start + end
    reached = length + path[-1].line.length - end
    while reached < length + BEYOND_GOAL and (following := _onward(roads, path[-1])) is not None:
        path.append(following)
        reached += following.line.length
    here = first.line.pose_at(start)
    points = [np.array([(here.x, here.y)]), first.line.points[first.line.s > start + 0.01]]
    points += [lane.line.points for lane in path[1:]]
    begins = np.cumsum([-start] + [lane.line.length for lane in path[:-1]])
    lanes = [(lane.id, float(s)) for lane, s in zip(path, begins, strict=True)]
    inside = [turn for turn in _turns(roads, lanes) if turn.start < length]
    line = _thinned(np.concatenate([*points]))
    if len(line) < 2:
        raise ValueError(
            f"found a way of {length:.2f} m in {roads.name} where the road ends, wanted a longer one: "
            "give a start and a goal farther apart, or another map"
        )
    return Route(Polyline(line), length, turns=tuple(inside), lanes=tuple(lanes))


def plan_route(roads: RoadNetwork, start: Pose, goal: Pose) -> Route:
    """The shortest route by A*. Raises ValueError where start or goal is off the road or cannot be reached."""
    (first, s), (last, end) = roads.lane_at(start), roads.lane_at(goal)
    if first.id == last.id and end > s:
        return follow_lanes(roads, [first.id], s, end)
    target = last.line.pose_at(0)

    def beeline(node: str, _: str) -> float:
        here = roads.lanes[node].line.pose_at(0)
        return math.hypot(here.x - target.x, here.y - target.y)

    best: tuple[float, list[str]] | None = None
    for successor in first.successors:
        try:
            ids = nx.astar_path(_graph(roads), successor, last.id, heuristic=beeline, weight="length")
        except nx.NetworkXNoPath:
            continue
        length = sum(roads.lanes[id].line.length for id in ids)
        if best is None or length < best[0]:
            best = (length, ids)
    if best is None:
        raise ValueError(
            f"found no way from ({start.x:.0f}, {start.y:.0f}) to ({goal.x:.0f}, {goal.y:.0f}) in {roads.name}: "
            "give a goal that lanes lead to"
        )
    return follow_lanes(roads, [first.id, *best[1]], s, end)


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
