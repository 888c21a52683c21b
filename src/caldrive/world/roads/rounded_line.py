"""A polyline as a smooth OpenDRIVE reference line: straight pieces, and one parametric cubic around each corner (ASAM
OpenDRIVE 1.8, section 9.6).

A corner is rounded over BLEND metres to either side, as `Polyline.heading_at` turns there, and less where the line
would leave the polyline by more than MOST_OFF. It is moved out before by half of what the rounding cuts off: then the
line runs as far outside the polyline between the corners as inside at them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from caldrive.datatypes import Points, Pose
from caldrive.geometry import BLEND, Polyline, mitres, moved, to_local, wrap_angle

MOST_OFF = 0.035  # m
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


def thinned(points: Points, least: float) -> Points:
    """Points (N, 2) without those nearer than so many metres to the one before, whose direction says more about their
    rounding to centimetres than about the road; the first and the last stay."""
    kept = [points[0]]
    for point in points[1:-1]:
        if np.hypot(*(point - kept[-1])) > least < np.hypot(*(points[-1] - point)):
            kept.append(point)
    return np.array([*kept, points[-1]])


def pieces_of(line: Polyline, first: float | None = None, last: float | None = None) -> list[Piece]:
    """The pieces of a line. first, last: headings (rad) in which it starts and ends, else those of its ends."""
    line = _moved_out(line)
    ways = [line.headings[0] if first is None else first, *line.headings, line.headings[-1] if last is None else last]
    steps = [0.0, *np.diff(line.s), 0.0]
    pieces, at = list[Piece](), Pose(line.points[0, 0], line.points[0, 1], ways[0])
    for k, (x, y) in enumerate(line.points.tolist()):
        turn, here = wrap_angle(ways[k + 1] - ways[k]), Pose(x, y, ways[k])
        before, after = (_reach(turn, step) for step in steps[k : k + 2])
        pieces += _straight(at, moved(here, -before))
        at = moved(moved(here, turn=turn), after)
        if before + after > 0:
            pieces.append(_corner(moved(here, -before), at))
    return pieces


def _reach(turn: float, step: float) -> float:
    """How far from a corner its rounding begins (m), on a step of some length."""
    return min(BLEND, step / 2, MOST_OFF / abs(turn / 8)) if abs(turn) > STRAIGHT else 0.0


def _moved_out(line: Polyline) -> Polyline:
    """A line with its corners moved out: an arc cuts off reach * turn / 4."""
    turns, steps = [0.0, *map(wrap_angle, np.diff(line.headings)), 0.0], np.pad(np.diff(line.s), 1).tolist()
    reaches = [(_reach(turn, a) + _reach(turn, b)) / 2 for turn, (a, b) in zip(turns, pairwise(steps), strict=True)]
    return Polyline(line.points - (np.array(reaches) * turns / 8)[:, None] * mitres(line.points))


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
