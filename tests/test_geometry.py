from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from caldrive.datatypes import Pose
from caldrive.geometry import (
    Polyline,
    added_up,
    box_corners,
    boxes_overlap,
    mitres,
    moved,
    polygon_distance,
    to_local,
    to_world,
    wrap_angle,
)

METRES = st.floats(-100, 100)
POSES = st.builds(Pose, METRES, METRES, st.floats(-math.pi, math.pi))
POINTS = st.lists(st.tuples(METRES, METRES), min_size=1, max_size=5).map(np.array)
BOXES = st.builds(box_corners, POSES, st.floats(0.5, 10), st.floats(0.5, 5))
UNIT = box_corners(Pose(0, 0, 0), 2, 2)


def test_numbers_are_added_up_in_turn_with_every_python() -> None:
    """As `sum` did before Python 3.12, to the last bit."""
    numbers = [0.1] * 10
    assert added_up(numbers) == 0.9999999999999999
    assert added_up(iter(numbers)) == 0.9999999999999999
    assert added_up([]) == 0.0


@given(st.floats(-1000, 1000))
def test_wrapped_angle_is_the_same_direction_within_half_a_turn(angle: float) -> None:
    wrapped = wrap_angle(angle)
    assert -math.pi < wrapped <= math.pi
    assert math.cos(wrapped - angle) == pytest.approx(1.0)


@given(POSES, POINTS)
def test_local_and_world_are_inverse(frame: Pose, points: np.ndarray) -> None:
    np.testing.assert_allclose(to_world(frame, to_local(frame, points)), points, atol=1e-9)


def test_local_x_is_ahead_and_y_is_left() -> None:
    north = Pose(10, 5, math.pi / 2)
    np.testing.assert_allclose(to_local(north, np.array([(10.0, 8.0), (9.0, 5.0)])), [(3, 0), (0, 1)], atol=1e-12)


@given(POSES, METRES, METRES)
def test_moving_there_and_back_returns(pose: Pose, forward: float, left: float) -> None:
    back = moved(moved(pose, forward, left), -forward, -left)
    assert (back.x, back.y) == (pytest.approx(pose.x, abs=1e-9), pytest.approx(pose.y, abs=1e-9))


@given(BOXES, BOXES)
def test_overlap_and_distance_are_symmetric_and_agree(first: np.ndarray, second: np.ndarray) -> None:
    assert boxes_overlap(first, second) == boxes_overlap(second, first)
    assert polygon_distance(first, second) == pytest.approx(polygon_distance(second, first))
    if boxes_overlap(first, second):
        assert polygon_distance(first, second) == 0.0
    if polygon_distance(first, second) > 1e-9:  # where they just touch, rounding decides
        assert not boxes_overlap(first, second)


@pytest.mark.parametrize(("x", "distance"), [(1.5, 0.0), (3.0, 1.0), (-4.0, 2.0)])
def test_distance_of_two_squares(x: float, distance: float) -> None:
    assert polygon_distance(UNIT, box_corners(Pose(x, 0.5, 0), 2, 2)) == pytest.approx(distance)


def test_a_corner_near_an_edge_does_not_overlap() -> None:
    assert not boxes_overlap(UNIT, box_corners(Pose(1.9, 1.9, math.pi / 4), 2, 2))
    assert boxes_overlap(UNIT, box_corners(Pose(1.6, 1.6, math.pi / 4), 2, 2))


def bend() -> Polyline:
    """A quarter circle of 20 m radius to the left, after 30 m straight."""
    angles = np.linspace(0, math.pi / 2, 64)
    arc = np.stack((30 + 20 * np.sin(angles), 20 * (1 - np.cos(angles))), axis=1)
    return Polyline(np.concatenate(([(0.0, 0.0)], arc)))


@given(st.floats(0, 1), st.floats(-3, 3))
def test_projecting_a_place_beside_the_line_finds_it_again(share: float, left: float) -> None:
    line = bend()
    s = share * line.length
    beside = moved(line.pose_at(s), left=left)
    found = line.project(beside.x, beside.y)
    assert found.s == pytest.approx(s, abs=0.1)
    assert found.left == pytest.approx(left, abs=0.02)
    near = line.project(beside.x, beside.y, near=s)
    assert near.s == pytest.approx(found.s)


def test_polyline_heading_turns_evenly() -> None:
    line = bend()
    assert line.length == pytest.approx(30 + 10 * math.pi, abs=0.01)
    assert line.heading_at(5.0) == pytest.approx(0.0, abs=1e-3)
    assert line.heading_at(30 + 5 * math.pi) == pytest.approx(math.pi / 4, abs=0.01)
    steps = np.diff([line.heading_at(s) for s in np.arange(31, 60, 0.25)])
    assert steps.min() > 0
    assert steps.max() < 0.25 / 20 * 1.1


def test_polyline_goes_straight_on_beyond_its_ends() -> None:
    line = Polyline(np.array([(0.0, 0.0), (10.0, 0.0)]))
    assert line.pose_at(15.0) == Pose(15.0, 0.0, 0.0)
    assert line.pose_at(-5.0) == Pose(-5.0, 0.0, 0.0)


def test_polyline_keeps_to_the_window() -> None:
    there_and_back = Polyline(np.array([(0.0, 0.0), (50.0, 0.0), (50.0, 4.0), (0.0, 4.0)]))
    assert there_and_back.project(10.0, 3.0).s == pytest.approx(94.0)
    assert there_and_back.project(10.0, 3.0, near=10.0).s == pytest.approx(10.0)


@pytest.mark.parametrize("points", [np.zeros((3, 2)), np.zeros((1, 2)), np.zeros((2, 3))])
def test_polyline_says_what_it_needs(points: np.ndarray) -> None:
    with pytest.raises(ValueError, match="a polyline needs"):
        Polyline(points)


def test_a_line_moved_along_its_mitres_is_as_far_away_everywhere() -> None:
    points = np.array([(0.0, 0.0), (10.0, 0.0), (10.0, 10.0), (0.0, 20.0)])
    beside = points + 2.0 * mitres(points)
    assert beside[1].tolist() == pytest.approx([8.0, 2.0])
    line = Polyline(points)
    assert [line.project(*middle).left for middle in (beside[1:] + beside[:-1]) / 2] == pytest.approx([2.0, 2.0, 2.0])
