"""A polyline as a smooth OpenDRIVE reference line: straight pieces, and one parametric cubic around each corner.

A corner is rounded as `Polyline.heading_at` turns there, over BLEND metres to either side, but never so far that the
line leaves the polyline by more than MOST_OFF (ASAM OpenDRIVE 1.8, section 9.6: paramPoly3).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from caldrive.datatypes import Points, Pose
from caldrive.geometry import BLEND, Polyline, moved, to_local, wrap_angle

LEAST_STEP = 0.25  # m; points nearer to the one before say more about rounding to centimetres than about the road
MOST_OFF = 0.03  # m
STRAIGHT = 1e-4  # rad
_NODES, _WEIGHTS = (values / 2 for values in np.polynomial.legendre.leggauss(8))


@dataclass(frozen=True)
class Piece:
    """A piece of a reference line."""

    start: Pose
    length: float
    """m."""
    cubic: NDArray[np.float64] | None = None
    """Coefficients (4, 2) of u and v by p in [0, 1], constant first, in the frame of the start; None for a line."""


def thinned(points: Points) -> Points:
    """Points (N, 2) without those nearer than LEAST_STEP to the one before; the first and the last stay."""
    kept = [points[0]]
    for point in points[1:-1]:
        if np.hypot(*(point - kept[-1])) > LEAST_STEP < np.hypot(*(points[-1] - point)):
            kept.append(point)
    return np.array([*kept, points[-1]])


def pieces_of(line: Polyline, first: float | None = None, last: float | None = None) -> list[Piece]:
    """The pieces of a line. first, last: headings (rad) in which it starts and ends, else those of its ends."""
    ways = [line.headings[0] if first is None else first, *line.headings, line.headings[-1] if last is None else last]
    steps = [0.0, *np.diff(line.s), 0.0]
    pieces, at = list[Piece](), Pose(*line.points[0], ways[0])
    for k, corner in enumerate(line.points):
        turn = wrap_angle(ways[k + 1] - ways[k])
        reach = min(BLEND, 4 * MOST_OFF / max(abs(turn), STRAIGHT))  # an arc leaves its corner by reach * turn / 4
        before, after = (min(reach, step / 2) for step in steps[k : k + 2])
        if abs(turn) < STRAIGHT:
            before = after = 0.0
        here = Pose(*corner, ways[k])
        start, end = moved(here, -before), moved(here, turn=turn)
        pieces += _straight(at, start)
        at = moved(end, after)
        if before + after > 0:
            pieces.append(_corner(start, at))
    return pieces


def _straight(start: Pose, end: Pose) -> list[Piece]:
    """A line to the next corner, where there is room for one."""
    length = math.hypot(end.x - start.x, end.y - start.y)
    return [Piece(start, length)] if length > 1e-6 else []


def _corner(start: Pose, end: Pose) -> Piece:
    """Cubic Hermite interpolation; with tangents as long as the chord it is nearly an arc, in even steps."""
    chord = to_local(start, np.array((end.x, end.y)))
    turn, size = end.heading - start.heading, math.hypot(*chord)
    leaves, arrives = size * np.array((1.0, 0.0)), size * np.array((math.cos(turn), math.sin(turn)))
    cubic = np.stack((0 * chord, leaves, 3 * chord - 2 * leaves - arrives, leaves + arrives - 2 * chord))
    p = _NODES[:, None] + 0.5
    speed = np.hypot(*(cubic[1] + 2 * p * cubic[2] + 3 * p**2 * cubic[3]).T)
    return Piece(start, float(speed @ _WEIGHTS), cubic)
