"""Smooth reference lines: they join without gaps and kinks, and stay at their polylines."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from caldrive.datatypes import Points, Pose
from caldrive.geometry import Polyline, moved, wrap_angle
from caldrive.world.roads.rounded_line import MOST_OFF, STRAIGHT, Piece, pieces_of, thinned


def pose_in(piece: Piece, p: float) -> Pose:
    """The pose at a share of a piece."""
    if piece.cubic is None:
        return moved(piece.start, p * piece.length)
    (u, v), (du, dv) = (
        (np.polynomial.Polynomial(c)(p) for c in piece.cubic.T),
        (np.polynomial.Polynomial(c).deriv()(p) for c in piece.cubic.T),
    )
    return moved(piece.start, u, v, turn=math.atan2(dv, du))


def arc(radius: float, step: float, sweep: float = math.pi / 2) -> Points:
    """Points on a circle around the origin, some m apart."""
    angles = np.linspace(0, sweep, round(radius * sweep / step) + 1)
    return radius * np.stack((np.cos(angles), np.sin(angles)), axis=1)


def test_a_straight_line_stays_one() -> None:
    (piece,) = pieces_of(Polyline(np.array([(1.0, 2.0), (4.0, 6.0)])))
    assert (piece.start, piece.length, piece.cubic) == (Pose(1, 2, math.atan2(4, 3)), 5.0, None)


steps = st.tuples(st.floats(0.3, 20), st.floats(-0.5, 0.5))


@settings(deadline=None, max_examples=50)
@given(st.lists(steps, min_size=2, max_size=8), st.floats(-0.2, 0.2), st.floats(-0.2, 0.2))
def test_pieces_join_without_gap_or_kink(walk: list[tuple[float, float]], first: float, last: float) -> None:
    points, heading = [np.zeros(2)], 0.0
    for length, turn in walk:
        heading += turn
        points.append(points[-1] + length * np.array((math.cos(heading), math.sin(heading))))
    line = Polyline(np.array(points))
    first, last = line.headings[0] + first, line.headings[-1] + last
    pieces = pieces_of(line, first, last)
    ends = [pose_in(piece, 1.0) for piece in pieces]
    begins = [piece.start for piece in pieces[1:]]
    for end, begin in zip(ends, begins, strict=False):
        assert (end.x, end.y) == pytest.approx((begin.x, begin.y), abs=1e-6)
        assert abs(wrap_angle(end.heading - begin.heading)) < 1.01 * STRAIGHT
    assert (pieces[0].start.x, pieces[0].start.y) == (0.0, 0.0)
    assert (ends[-1].x, ends[-1].y) == pytest.approx(points[-1], abs=1e-6)
    assert abs(wrap_angle(pieces[0].start.heading - first)) < 1.01 * STRAIGHT
    assert abs(wrap_angle(ends[-1].heading - last)) < 1.01 * STRAIGHT
    poses = [pose_in(piece, p) for piece in pieces for p in np.linspace(0, 1, 9)]
    assert max(abs(line.project(pose.x, pose.y).left) for pose in poses) < 1.2 * MOST_OFF


@pytest.mark.parametrize(("radius", "step"), [(20.0, 1.0), (14.0, 2.0), (8.0, 2.0)])
def test_a_coarse_circle_becomes_a_smooth_one(radius: float, step: float) -> None:
    pieces = pieces_of(Polyline(arc(radius, step)))[1:-1]  # at its ends it has no neighbour to turn to
    for piece in pieces:
        for p in np.linspace(0, 1, 9):
            pose = pose_in(piece, p)
            assert math.hypot(pose.x, pose.y) == pytest.approx(
                radius - step**2 / radius / 16, abs=step**2 / radius / 12
            )
            tangent = math.atan2(pose.y, pose.x) + math.pi / 2
            assert math.degrees(wrap_angle(pose.heading - tangent)) == pytest.approx(0, abs=1.5)
    assert sum(piece.length for piece in pieces) == pytest.approx(radius * math.pi / 2, abs=2 * step)


def test_points_close_together_tell_no_direction() -> None:
    points = np.array([(0, 0), (10, 0), (10.01, 0.01), (9.99, 0.01), (20, 0), (20.2, 0)], dtype=float)
    assert thinned(points, 0.5).tolist() == [[0, 0], [10, 0], [20.2, 0]]
