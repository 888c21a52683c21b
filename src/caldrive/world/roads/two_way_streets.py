"""The streets of a network from junction to junction, both directions together, and the turns from street to street.

The network is one of lanes; a place where only the limit changes parts two of them. What OpenDRIVE calls a road is the
whole street.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from caldrive.geometry import moved
from caldrive.world.roads.network import Lane, RoadNetwork

SAME_BORDER = 0.5  # m by which the ends of the left borders of two directions of a street may be apart
Edge = tuple[Lane, ...]  # lanes side by side that lead the same way, the leftmost first


@dataclass(frozen=True)
class Street:
    """A street: edges one after the other, each as the traffic on it meets them."""

    ahead: tuple[Edge, ...]
    back: tuple[Edge, ...] = ()
    """Those of the other direction, none where it is one-way."""


@dataclass(frozen=True)
class Turn:
    """A way through a junction, from a lane of one street to a lane of the next."""

    start: Lane
    inside: tuple[Lane, ...]
    end: Lane


def find_streets(roads: RoadNetwork) -> tuple[list[Street], list[Turn]]:
    """All streets, and all turns at the junctions between them."""
    turns = [turn for lane in roads.driveable for turn in _turns(roads, lane)]
    edges = _edges(roads)
    opposite = _opposites(edges)
    onward = _onward(edges, opposite, turns, {post.lane for post in roads.posts})
    streets = []
    for way in _chains(edges, onward, opposite):
        back = [edges[opposite[edge]] for edge in reversed(way) if edge in opposite]
        streets.append(Street(tuple(edges[edge] for edge in way), tuple(back)))
    return streets, [turn for turn in turns if onward.get(turn.start.edge) != turn.end.edge]


def _turns(roads: RoadNetwork, start: Lane) -> Iterator[Turn]:
    """All ways from a lane to those after the next junction."""
    ways: list[tuple[Lane, ...]] = [(roads.lanes[id],) for id in start.successors]
    for way in ways:  # which grows as it is read
        if way[-1].internal:
            ways += [(*way, roads.lanes[id]) for id in way[-1].successors]
        else:
            yield Turn(start, way[:-1], way[-1])


def _edges(roads: RoadNetwork) -> dict[str, Edge]:
    """The lanes side by side by the ids of their edges."""
    sides = defaultdict[str, list[Lane]](list)
    for lane in roads.driveable:
        sides[lane.edge].append(lane)
    return {id: tuple(sorted(side, key=lambda lane: -int(lane.id.rpartition("_")[2]))) for id, side in sides.items()}


def _opposites(edges: Mapping[str, Edge]) -> dict[str, str]:
    """The other direction of each edge that has one: their left borders run between the same places."""
    ids = list(edges)
    borders = np.array([_left_border(edges[id][0]) for id in ids])
    apart = np.abs(borders[:, None] - borders[None, :, ::-1]).max((-1, -2))
    return {ids[i]: ids[j] for i, j in zip(*np.nonzero(apart < SAME_BORDER), strict=True)}


def _left_border(lane: Lane) -> list[tuple[float, float]]:
    ends = (moved(lane.line.pose_at(s), left=lane.width / 2) for s in (0.0, lane.line.length))
    return [(end.x, end.y) for end in ends]


def _onward(
    edges: Mapping[str, Edge], opposite: Mapping[str, str], turns: Sequence[Turn], lit: set[str]
) -> dict[str, str]:
    """The edge with which each goes on as one street, in both directions. lit: lanes that a light ends."""
    leaving, entering = defaultdict[str, list[Turn]](list), defaultdict[str, list[Turn]](list)
    for turn in turns:
        leaving[turn.start.edge].append(turn)
        entering[turn.end.edge].append(turn)

    def goes_on(start: str, end: str) -> bool:
        alike = [(lane.id, next_.id) for lane, next_ in zip(edges[start], edges[end], strict=False)]
        is_only_way = len(leaving[start]) == len(entering[end]) == len(edges[start]) == len(edges[end])
        is_no_junction = not any(lane.turn for turn in leaving[start] for lane in turn.inside) and start != end
        lanes_stay = {(turn.start.id, turn.end.id) for turn in leaving[start]} == set(alike)
        return is_only_way and is_no_junction and lanes_stay and lit.isdisjoint(id for id, _ in alike)

    ways = {start: out[0].end.edge for start, out in leaving.items() if goes_on(start, out[0].end.edge)}

    def comes_back(start: str, end: str) -> bool:
        there, here = opposite.get(end), opposite.get(start)
        return here is None if there is None else here is not None and ways.get(there) == here

    return {start: end for start, end in ways.items() if comes_back(start, end)}


def _chains(edges: Mapping[str, Edge], onward: Mapping[str, str], opposite: Mapping[str, str]) -> Iterator[list[str]]:
    """The edges of each street, in one of its directions."""
    before, seen = {end: start for start, end in onward.items()}, set[str]()
    for edge in sorted(edges, key=lambda id: (id.startswith("-"), id)):
        if edge not in seen:
            way = [edge]
            while (previous := before.get(way[0])) is not None and previous not in way:
                way.insert(0, previous)
            while (following := onward.get(way[-1])) is not None and following not in way:
                way.append(following)
            seen.update(way, (opposite[id] for id in way if id in opposite))
            yield way
