"""What the command would ask for if it were another one: the same image with other labels.

A car that comes to a junction drives one way only, but its camera sees the others, too. The angle and the distance to
their lines are as true as those to its own, and no turn is seen as often from beside its line as one not taken.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from caldrive.datatypes import MAX_CENTER_DISTANCE, Alternative, Command, Pose
from caldrive.geometry import Polyline
from caldrive.world.roads.network import RoadNetwork
from caldrive.world.roads.route import COMMAND_AHEAD, Route, follow_lanes
from caldrive.world.truth.labels import to_line

FARTHEST = 4.0  # m beside its line from which a way can still be taken


@dataclass(frozen=True)
class Fork:
    """Another way at a junction of a route."""

    command: Command
    """Asks for it."""
    line: Polyline
    """Its middle; up to the junction it is the route's."""
    offset: float
    """m of the route where the line begins."""
    start: float
    """m of the route from which on the command can be given."""
    end: float
    """m of the route up to which it can be given."""


def forks(roads: RoadNetwork, route: Route) -> list[Fork]:
    """All other ways at the junctions of a route, in its order; none to where one command leads to several lanes."""
    others, turns = [], {round(turn.start, 3): turn for turn in route.turns}
    for (before, offset), (_, start) in pairwise(route.lanes):
        if (turn := turns.get(round(start, 3))) is None:
            continue
        begin = max(0.0, offset)
        ways = [roads.lanes[id] for id in roads.lanes[before].successors]
        commands = [way.turn for way in ways]
        for way in ways:
            if way.turn not in (None, turn.command) and commands.count(way.turn) == 1:
                ids = [before, way.id, *way.successors[:1]]
                line = follow_lanes(roads, ids, max(0.0, -offset), roads.lanes[ids[-1]].line.length).line
                given_from = max(begin, turn.start - COMMAND_AHEAD)
                others.append(Fork(way.turn, line, offset=begin, start=given_from, end=turn.end))
    return others


def alternatives(axle: Pose, ways: Sequence[Fork], s: float) -> list[Alternative]:
    """The other commands that could be given at s m of the route, and what they ask of a car with this front axle."""
    others = []
    for fork in ways:
        if fork.start <= s <= fork.end:
            angle, distance, _ = to_line(axle, fork.line, s - fork.offset)
            if abs(distance) <= FARTHEST:
                clipped = float(np.clip(distance, -MAX_CENTER_DISTANCE, MAX_CENTER_DISTANCE))
                others.append(Alternative(fork.command, relative_angle=angle, center_distance=clipped))
    return others
