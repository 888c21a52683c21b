"""Streets as the painter of markings sees them: lanes joined from junction to junction, and their borders."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import IntEnum

import numpy as np
import shapely
from numpy.typing import NDArray

from caldrive.geometry import Polyline
from caldrive.world.roads.network import Lane, RoadNetwork


class Border(IntEnum):
    """What is painted along one side of a lane."""

    NOTHING = 0
    CENTER = 1  # broken
    EDGE = 2
    DIVIDER = 3  # parts lanes of one direction
    SOLID_CENTER = 4  # a centre line near a junction


@dataclass(frozen=True)
class Chain:
    """Lanes one after the other between two junctions. stop: whether a stop line ends it."""

    line: Polyline
    width: float
    left: Border
    right: Border
    stop: bool


def _inside_junctions(lanes: dict[str, Lane]) -> set[str]:
    """Internal lanes of true junctions, with those that follow them inside."""
    inside = {lane.id for lane in lanes.values() if lane.turn is not None}
    frontier = list(inside)
    while frontier:
        onward = [s for s in lanes[frontier.pop()].successors if lanes[s].internal and s not in inside]
        inside.update(onward)
        frontier.extend(onward)
    return inside


def _following(lane: Lane, inside: set[str]) -> str | None:
    """The one lane that a lane runs on into, or None at a junction or fork."""
    return lane.successors[0] if len(lane.successors) == 1 and lane.successors[0] not in inside else None


def _walk(first: Lane, lanes: dict[str, Lane], inside: set[str], seen: set[str]) -> list[Lane]:
    parts: list[Lane] = []
    id: str | None = first.id
    while id is not None and id not in seen:
        seen.add(id)
        parts.append(lanes[id])
        id = _following(lanes[id], inside)
    return parts


class _Beside:
    """Finds the direction of the traffic under a point."""

    def __init__(self, lanes: tuple[Lane, ...]) -> None:
        self.starts = np.concatenate([lane.line.points[:-1] for lane in lanes])
        self.ends = np.concatenate([lane.line.points[1:] for lane in lanes])
        self.headings = np.concatenate([lane.line.headings for lane in lanes])

    def heading(self, point: NDArray[np.float64], within: float) -> float | None:
        along = self.ends - self.starts
        t = ((point - self.starts) * along).sum(1) / np.maximum((along**2).sum(1), 1e-9)
        gap = np.hypot(*(point - self.starts - np.clip(t, 0, 1)[:, None] * along).T)
        k = int(np.argmin(gap))
        return float(self.headings[k]) if gap[k] < within else None

    def border(self, lane: Lane, side: int) -> Border:
        """What parts a lane from whatever lies to its left (side 1) or right (-1)."""
        middle = lane.line.pose_at(lane.line.length / 2)
        reach = side * (lane.width / 2 + 1.0)
        point = np.array([middle.x - reach * math.sin(middle.heading), middle.y + reach * math.cos(middle.heading)])
        beyond = self.heading(point, lane.width / 2)
        if beyond is None:
            return Border.EDGE
        if math.cos(beyond - middle.heading) < 0:
            return Border.CENTER
        return Border.DIVIDER if side > 0 else Border.NOTHING


def chains(roads: RoadNetwork) -> list[Chain]:
    """All streets of a town; places where only the limit changes do not break them."""
    lanes, posts = roads.lanes, {post.lane for post in roads.posts}
    inside = _inside_junctions(lanes)
    drawn = [lane for lane in lanes.values() if lane.id not in inside]
    continued = {_following(lane, inside) for lane in drawn}
    starts = [lane for lane in drawn if lane.id not in continued]
    beside, seen, found = _Beside(roads.driveable), set[str](), []
    for first in [*starts, *drawn]:  # the second turn takes up closed rings, which have no start
        parts = _walk(first, lanes, inside, seen)
        if parts:
            points = shapely.LineString(np.concatenate([p.line.points for p in parts])).simplify(0.02)
            line = Polyline(shapely.get_coordinates(points))
            longest = max(parts, key=lambda p: p.line.length)
            left, right = beside.border(longest, 1), beside.border(longest, -1)
            found.append(Chain(line, longest.width, left, right, parts[-1].id in posts))
    return found
