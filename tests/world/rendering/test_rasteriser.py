"""What each sample of a picture shows: what is nearest, whole, and without a gap between neighbours."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from caldrive.world.rendering.fragments import SAMPLES, fragments_of, make_planes, room_for, seen
from caldrive.world.rendering.rasteriser import NEAR, POLYGON, rasterise

ROWS, COLUMNS = 24, 32
UPPER_LEFT, UPPER_RIGHT, LOWER_RIGHT, LOWER_LEFT = (-1, -1), (1, -1), (1, 1), (-1, 1)


def shown(*triangles: list[tuple[float, float, float]]) -> tuple[np.ndarray, np.ndarray]:
    """Numbers of triangles (ROWS, COLUMNS), and 1/w there; corners: x, y and w, of a point in view |x|, |y| < 1."""
    points = np.array(triangles, np.float32)
    corners = np.concatenate((points[..., :2] * points[..., 2:], points[..., 2:]), axis=-1)
    depths, numbers = np.empty((ROWS, COLUMNS), np.float32), np.empty((ROWS, COLUMNS), np.int32)
    rasterise(corners, len(corners), depths, numbers, np.empty((POLYGON, 4), np.float32))
    return numbers, depths


def wall(w: float) -> list[list[tuple[float, float, float]]]:
    """Two triangles over the whole picture."""
    a, b, c, d = ((*corner, w) for corner in (UPPER_LEFT, LOWER_LEFT, LOWER_RIGHT, UPPER_RIGHT))
    return [[a, b, c], [a, c, d]]


inside = st.floats(-0.9375, 0.9375, width=32)


@given(x=inside, y=inside, w=st.lists(st.floats(0.3125, 50, width=32), min_size=5, max_size=5))
@settings(deadline=None, max_examples=200)
def test_triangles_that_share_edges_leave_no_gap(x: float, y: float, w: list[float]) -> None:
    around = [(*corner, w[k]) for k, corner in enumerate((UPPER_LEFT, LOWER_LEFT, LOWER_RIGHT, UPPER_RIGHT))]
    fan = [[(x, y, w[4]), around[k], around[(k + 1) % 4]] for k in range(4)]
    numbers, depths = shown(*fan)
    assert (numbers >= 0).all()
    assert depths.max() <= 1.001 / min(w)
    assert depths.min() >= 0.999 / max(w)


def test_what_is_nearer_hides_what_is_farther_whatever_comes_first() -> None:
    for order in (1, -1):
        numbers, depths = shown(*(wall(5.0) + wall(3.0))[::order])
        assert set(np.unique(numbers)) == ({2, 3} if order == 1 else {0, 1})
        assert depths == pytest.approx(1 / 3)


def test_a_back_is_not_drawn() -> None:
    numbers, _ = shown(*(triangle[::-1] for triangle in wall(5.0)))
    assert (numbers == -1).all()


def test_what_lies_behind_the_camera_is_cut_off() -> None:
    ground = [(-2.0, 1.0, 2.0), (2.0, 1.0, 2.0)]
    corners = np.array([[(x * w, y * w, w) for x, y, w in ground] + [(0.0, 1.0, -4.0)]], np.float32)[:, [0, 2, 1]]
    depths, numbers = np.empty((ROWS, COLUMNS), np.float32), np.empty((ROWS, COLUMNS), np.int32)
    for triangle in (corners, corners[:, ::-1]):
        rasterise(np.ascontiguousarray(triangle), 1, depths, numbers, np.empty((POLYGON, 4), np.float32))
        assert depths.max() <= 1 / NEAR + 1e-3
        assert set(np.unique(numbers)) <= {-1, 0}


def test_what_is_seen_is_numbered_anew() -> None:
    numbers, _ = shown(*wall(3.0), *wall(5.0), [(-1, -1, 1.0), (-1, 0, 1.0), (0, -1, 1.0)])
    triangles = np.empty(5, np.int32)
    many = seen(numbers, 5, np.empty(5, np.int32), triangles)
    assert triangles[:many].tolist() == [0, 1, 4]
    assert set(np.unique(numbers)) == {0, 1, 2}


def test_a_pixels_fragments_make_it_up() -> None:
    numbers, _ = shown(*wall(3.0), [(-1, -0.93, 1.0), (-0.3, 0.7, 1.0), (0.9, -0.8, 1.0)])
    pixels = ROWS // SAMPLES * COLUMNS // SAMPLES
    room = room_for(pixels)
    n = fragments_of(numbers, 0, ROWS // SAMPLES, room)
    shares = np.bincount(room.pixel[:n], weights=room.share[:n], minlength=pixels)
    assert shares == pytest.approx(1.0)
    assert n > pixels


@given(column=st.integers(0, 15), row=st.integers(0, 11))
@settings(deadline=None)  # the first example compiles
def test_a_plane_gives_back_what_the_corners_carry(column: int, row: int) -> None:
    corners = np.array([(-2.0, -3.0, 2.0), (-4.0, 5.0, 5.0), (6.0, 1.0, 9.0)], np.float32)
    values = np.array([(1.0, 10.0), (2.0, 20.0), (3.0, 50.0)], np.float32)
    planes = np.empty(9, np.float32)
    make_planes(corners, values, 16, 12, planes)
    inverse, *over = (plane @ (1.0, column, row) for plane in planes.reshape(3, 3))
    x, y = (column + 0.5) / 8 - 1, (row + 0.5) / 6 - 1
    shares = np.linalg.solve(corners.T.astype(float), (x, y, 1.0))  # of the corners, where the ray meets their plane
    assert inverse == pytest.approx(shares.sum(), abs=1e-4)
    assert over == pytest.approx(shares @ values, abs=2e-3)
