"""A network as the roads of OpenDRIVE: its streets, and a connecting road for each turn at a junction (ASAM OpenDRIVE
1.8, sections 10 to 12).

The reference line of a street is its middle, or the left border of a one-way street. That of a connecting road is the
very line on which cars turn; a lane offset puts the lane around it. Lanes count outwards from the middle: -1, -2 along
the reference line, 1, 2 against it. A sidewalk is the outermost lane, where there is one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
import shapely

from caldrive.datatypes import Pose
from caldrive.geometry import Polyline, added_up, mitres, moved, to_local
from caldrive.world.roads.network import SIDEWALK_WIDTH, RoadNetwork
from caldrive.world.roads.rounded_line import Piece, pieces_of, thinned
from caldrive.world.roads.two_way_streets import Edge, Street, Turn, find_streets

STEPS = 10  # after which a place beside a line is found; each leaves a third of the error, or less
LEAST_STEP, LEAST_STEP_INSIDE = 0.5, 0.1  # m from one point of a street to the next, and within a junction
GRAIN = 1.0  # m along a kerb from one look for a sidewalk to the next


@dataclass(frozen=True)
class Side:
    """The lanes of a road in one direction; on the left of a one-way road there are none, but may be a sidewalk."""

    edges: tuple[Edge, ...] = ()
    """As its traffic meets them."""
    sidewalk: bool = False
    """Whether there is one beyond the lanes."""

    @property
    def widths(self) -> tuple[float, ...]:
        """Of its lanes for cars, from the middle outwards, m."""
        return tuple(lane.width for lane in self.edges[0]) if self.edges else ()


@dataclass(frozen=True)
class Contact:
    """The end of a street at which a connecting road begins or ends."""

    road: int
    at_end: bool
    lanes: dict[int, int]
    """The street's lanes that are joined, by the numbers of the connecting road's."""


@dataclass(frozen=True, eq=False)
class OpenDriveRoad:
    """A street or a connecting road."""

    id: int
    line: Polyline
    """The reference line, with corners."""
    right: Side
    left: Side = Side()
    ends: tuple[int | Contact | None, int | Contact | None] = (None, None)
    """What it begins and ends at: a street at junctions or nowhere, a connecting road at streets."""
    junction: int | None = None
    """That of a connecting road."""
    headings: tuple[float | None, float | None] = (None, None)
    """With which a connecting road begins and ends, rad: those of the streets."""

    @property
    def offset(self) -> float:
        """m from the reference line to the left, where lanes count from."""
        return 0.0 if self.junction is None else self.right.widths[0] / 2

    @property
    def sidewalks(self) -> tuple[int, int]:
        """The numbers of the lanes that are sidewalks, on the right and on the left; 0 where there is none."""
        right, left = (len(side.widths) + 1 if side.sidewalk else 0 for side in (self.right, self.left))
        return -right, left

    @cached_property
    def pieces(self) -> list[Piece]:
        """The reference line, smooth."""
        return pieces_of(self.line, *self.headings)

    @cached_property
    def length(self) -> float:
        """Of the smooth line, m."""
        return added_up(piece.length for piece in self.pieces)

    def locate(self, x: float, y: float) -> tuple[float, float]:
        """A place as m along the smooth line, and to its left."""
        s, left = self.line.project(x, y).s, 0.0
        for _ in range(STEPS):  # the nearest place on a line with corners need not be the one right beside
            ahead, left = to_local(self.line.pose_at(s), np.array((x, y))).tolist()
            s = min(max(s + ahead, 0.0), self.line.length)
        return s / self.line.length * self.length, left

    def middle(self, lane: int) -> float:
        """m from the reference line to the left, where a lane's middle is."""
        widths = (self.right if lane < 0 else self.left).widths
        across = added_up(widths[: abs(lane) - 1]) + widths[abs(lane) - 1] / 2
        return self.offset + (-across if lane < 0 else across)

    def end_of(self, lane: int, *, leaving: bool) -> Pose:
        """Where the traffic of a lane leaves it, or comes onto it."""
        at_end = (lane < 0) == leaving
        end = moved(self.line.pose_at(self.line.length if at_end else 0.0), left=self.middle(lane))
        return end if lane < 0 else moved(end, turn=math.pi)


@dataclass(frozen=True)
class OpenDriveNetwork:
    """All roads of a network."""

    streets: tuple[OpenDriveRoad, ...]
    connecting: tuple[OpenDriveRoad, ...]
    junctions: dict[str, int]
    """Their numbers by SUMO's names of them."""
    places: dict[str, tuple[int, int]] = field(repr=False)
    """Of each lane outside junctions the number of its street, and its own there."""

    @property
    def next_id(self) -> int:
        """The first number after all of these."""
        return len(self.streets) + len(self.junctions) + len(self.connecting)


def opendrive_roads(roads: RoadNetwork) -> OpenDriveNetwork:
    """The roads of a network, numbered from 0; then come the junctions, and then the connecting roads.

    Raises ValueError for a town with hills: it comes from an OpenDRIVE map, which says more.
    """
    if any(lane.heights is not None for lane in roads.lanes.values()):
        raise ValueError(f"found hills in {roads.name}, wanted a flat town: take the map that it was read from")
    found, turns = find_streets(roads)
    streets = [_street(roads, id, street) for id, street in enumerate(found)]
    places = {
        lane.id: (road.id, sign * (k + 1))
        for road in streets
        for sign, side in ((-1, road.right), (1, road.left))
        for edge in side.edges
        for k, lane in enumerate(edge)
    }
    names = sorted({_junction_of(turn) for turn in turns})
    junctions = {name: len(streets) + k for k, name in enumerate(names)}
    connecting = []
    for id, turn in enumerate(turns, len(streets) + len(names)):
        number = junctions[_junction_of(turn)]
        (before, from_lane), (after, to_lane) = places[turn.start.id], places[turn.end.id]
        for street, at_end in ((before, from_lane < 0), (after, to_lane > 0)):
            first, last = streets[street].ends
            streets[street] = replace(streets[street], ends=(first, number) if at_end else (number, last))
        connecting.append(
            _connecting(roads, (id, number), turn, (streets[before], from_lane), (streets[after], to_lane))
        )
    return OpenDriveNetwork(tuple(streets), tuple(connecting), junctions, places)


def _junction_of(turn: Turn) -> str:
    """SUMO's name of a junction, which is part of the ids of the lanes in it."""
    return turn.inside[0].id[1:].rsplit("_", 2)[0]


def _street(roads: RoadNetwork, id: int, street: Street) -> OpenDriveRoad:
    points = thinned(np.concatenate([edge[0].line.points for edge in street.ahead]), LEAST_STEP)
    line = Polyline(points + street.ahead[0][0].width / 2 * mitres(points))
    return _with_sidewalks(roads, OpenDriveRoad(id, line, Side(street.ahead), Side(street.back)))


def _connecting(
    roads: RoadNetwork,
    ids: tuple[int, int],
    turn: Turn,
    start: tuple[OpenDriveRoad, int],
    end: tuple[OpenDriveRoad, int],
) -> OpenDriveRoad:
    """The road of a turn. ids: its own and its junction's; start, end: the streets that it joins, and their lanes."""
    first, last = start[0].end_of(start[1], leaving=True), end[0].end_of(end[1], leaving=False)
    inside = np.concatenate([lane.line.points for lane in turn.inside])[1:-1]
    line = Polyline(thinned(np.array([(first.x, first.y), *inside, (last.x, last.y)]), LEAST_STEP_INSIDE))
    road = OpenDriveRoad(
        ids[0], line, Side((turn.inside[:1],)), junction=ids[1], headings=(first.heading, last.heading)
    )
    road = _with_sidewalks(roads, road)
    return replace(road, ends=(_contact(road, *start, leaving=True), _contact(road, *end, leaving=False)))


def _contact(road: OpenDriveRoad, street: OpenDriveRoad, lane: int, *, leaving: bool) -> Contact:
    """How a connecting road joins a lane of a street, and each of its sidewalks the street's on the same side."""
    along = lane < 0
    walks = street.sidewalks if along else street.sidewalks[::-1]
    pairs = {-1: lane} | {own: theirs for own, theirs in zip(road.sidewalks, walks, strict=True) if own and theirs}
    return Contact(street.id, along == leaving, pairs)


def _with_sidewalks(roads: RoadNetwork, road: OpenDriveRoad) -> OpenDriveRoad:
    """A road with the sidewalks that run along all of it."""
    edges = (road.offset - added_up(road.right.widths), road.offset + added_up(road.left.widths))
    right, left = edges[0] - SIDEWALK_WIDTH / 2, edges[1] + SIDEWALK_WIDTH / 2
    return replace(
        road,
        right=replace(road.right, sidewalk=_is_off_the_road(roads, road.line, right)),
        left=replace(road.left, sidewalk=_is_off_the_road(roads, road.line, left)),
    )


def _is_off_the_road(roads: RoadNetwork, line: Polyline, left: float) -> bool:
    """Whether nobody drives so many metres to the left of a line."""
    along = np.linspace(0.0, line.length, max(2, math.ceil(line.length / GRAIN))).tolist()
    poses = [moved(line.pose_at(s), left=left) for s in along]
    shapely.prepare(roads.roadway)  # once; asked again it returns at once
    return not shapely.intersects_xy(roads.roadway, [p.x for p in poses], [p.y for p in poses]).any()
