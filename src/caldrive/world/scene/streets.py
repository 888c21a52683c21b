"""Streets as road markings see them: lanes joined from junction to junction, and what is painted beside them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import IntEnum

import numpy as np
import shapely
from numpy.typing import NDArray

from caldrive.geometry import Polyline, moved, points_to_segments
from caldrive.world.roads.levels import crossings
from caldrive.world.roads.network import Lane, RoadNetwork

GAP = 0.5  # m around a place where roads run above each other, without markings


class Border(IntEnum):
    """What is painted along one side of a lane."""

    NOTHING = 0
    CENTER = 1  # broken
    EDGE = 2
    DIVIDER = 3  # parts lanes of one direction
    SOLID_CENTER = 4  # a centre line near a junction


@dataclass(frozen=True)
class LaneChain:
    """Lanes one after the other between two junctions."""

    line: Polyline
    """Their middle."""
    width: float
    """m."""
    left: Border
    right: Border
    stop: bool
    """Whether a stop line ends it."""


def lane_chains(roads: RoadNetwork) -> list[LaneChain]:
    """All streets of a town; places where only the limit changes do not break them, but those do where a street runs
    above or below another."""
    lanes, posts = roads.lanes, {post.lane for post in roads.posts}
    inside = _inside_junctions(lanes)
    painted = [lane for lane in lanes.values() if lane.id not in inside]
    continued = {_following(lane, inside, posts) for lane in painted}
    starts = [lane for lane in painted if lane.id not in continued]
    neighbours, seen, chains = _LaneSegments(roads.driveable), set[str](), []
    gaps = crossings(roads).buffer(GAP)
    for first in [*starts, *painted]:  # the second turn takes up closed rings, which have no start
        parts = _walk(first, lanes, inside, posts, seen)
        if parts:
            points = shapely.LineString(np.concatenate([lane.line.points for lane in parts])).simplify(0.02)
            longest = max(parts, key=lambda lane: lane.line.length)
            pieces = [part for part in shapely.get_parts(points.difference(gaps)) if part.length > GAP]
            chains += [
                LaneChain(
                    line=Polyline(shapely.get_coordinates(piece)),
                    width=longest.width,
                    left=neighbours.border(longest, side=1),
                    right=neighbours.border(longest, side=-1),
                    stop=parts[-1].id in posts and piece is pieces[-1],
                )
                for piece in pieces
            ]
    return chains


def _inside_junctions(lanes: dict[str, Lane]) -> set[str]:
    """Ids of internal lanes of true junctions, with those that follow them inside."""
    inside = {lane.id for lane in lanes.values() if lane.turn is not None}
    frontier = list(inside)
    while frontier:
        onward = [s for s in lanes[frontier.pop()].successors if lanes[s].internal and s not in inside]
        inside.update(onward)
        frontier.extend(onward)
    return inside


def _following(lane: Lane, inside: set[str], posts: set[str]) -> str | None:
    """The one lane that a lane runs on into, or None at a junction, a fork or a stop line."""
    if len(lane.successors) != 1 or lane.successors[0] in inside or lane.id in posts:
        return None
    return lane.successors[0]


def _walk(first: Lane, lanes: dict[str, Lane], inside: set[str], posts: set[str], seen: set[str]) -> list[Lane]:
    """Lanes from the first to the end of its street, up to one seen before."""
    parts: list[Lane] = []
    id: str | None = first.id
    while id is not None and id not in seen:
        seen.add(id)
        parts.append(lanes[id])
        id = _following(lanes[id], inside, posts)
    return parts


class _LaneSegments:
    """The segments of all lanes' middles, to find the direction of the traffic at a point."""

    def __init__(self, lanes: tuple[Lane, ...]) -> None:
        self.starts = np.concatenate([lane.line.points[:-1] for lane in lanes])
        self.ends = np.concatenate([lane.line.points[1:] for lane in lanes])
        self.headings = np.concatenate([lane.line.headings for lane in lanes])

    def heading(self, point: NDArray[np.float64], within: float) -> float | None:
        """The heading (rad) of the lane nearest to a point (2,), None where there is none within so many metres."""
        gap = points_to_segments(point[None], self.starts, self.ends)[0]
        k = int(np.argmin(gap))
        return float(self.headings[k]) if gap[k] < within else None

    def border(self, lane: Lane, side: int) -> Border:
        """What parts a lane from whatever lies to its left (side 1) or right (-1)."""
        middle = lane.line.pose_at(lane.line.length / 2)
        beside = moved(middle, left=side * (lane.width / 2 + 1.0))
        beyond = self.heading(np.array([beside.x, beside.y]), within=lane.width / 2)
        if beyond is None:
            return Border.EDGE
        if math.cos(beyond - middle.heading) < 0:
            return Border.CENTER
        return Border.DIVIDER if side > 0 else Border.NOTHING
