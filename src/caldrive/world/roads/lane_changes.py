"""Changes from lane to lane: where on a route they are, and the line that they take."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from caldrive.datatypes import Points
from caldrive.world.roads.network import Lane, RoadNetwork

CHANGE_ROOM, CHANGE_LENGTH = 20.0, 40.0  # m of lane that a change needs, and that it takes where there is room


@dataclass(frozen=True)
class LaneChange:
    """Where a route leaves one lane for the one beside it."""

    start: float
    """m along the route."""
    end: float
    """m along the route."""
    to_left: bool


def stretches_of(roads: RoadNetwork, ids: Sequence[str]) -> list[list[Lane]]:
    """Lanes one after the other, with those side by side together."""
    stretches: list[list[Lane]] = []
    for lane in (roads.lanes[id] for id in ids):
        if stretches and lane.id in roads.beside(stretches[-1][-1]) and lane.id not in stretches[-1][-1].successors:
            stretches[-1].append(lane)
        else:
            stretches.append([lane])
    return stretches


def middles_of_changes(n: int, low: float, high: float) -> list[tuple[float, float]]:
    """Middle and half length (m) of each of n changes between two places on a lane."""
    room = (high - low) / max(n, 1)
    return [(low + room * (k + 0.5), min(CHANGE_LENGTH, 0.9 * room) / 2) for k in range(n)]


def across(lanes: list[Lane], middles: list[tuple[float, float]], low: float) -> Points:
    """Points (N, 2) from a place on the first of some lanes side by side to the end of the last, each change a smooth
    step."""
    length = lanes[-1].line.length
    s = np.append(np.arange(low, length, 1.0), length)
    share = [np.clip((s - middle) / (2 * half) + 0.5, 0.0, 1.0) for middle, half in middles]
    weight = [t * t * (3 - 2 * t) for t in share]
    points = lanes[0].line.points_at(s / length * lanes[0].line.length)
    for lane, w in zip(lanes[1:], weight, strict=True):
        points = points + w[:, None] * (lane.line.points_at(s / length * lane.line.length) - points)
    return points
