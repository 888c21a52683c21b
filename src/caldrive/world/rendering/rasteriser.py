"""The rasteriser: which of many triangles each sample of a picture shows.

A triangle comes as the clip coordinates of its corners: x and y over the half width and half height of the picture, to
the right and down, and w, the distance along the optical axis in m. A point is in the picture where |x|, |y| <= w. What
is nearest is found with a buffer of 1/w, which is linear over a picture.
"""

from __future__ import annotations

import numpy as np

from caldrive.compiled import Floats, Integers, compiled, f32, i32, inlined

NEAR = f32(0.25)  # m, what lies nearer is cut off
POLYGON = 5  # corners of what is left of a quadrilateral beyond the near plane
SLOPE = 3  # where a polygon's corner has the slope of its edge, after its coordinates
NOTHING = -1  # shown by a sample without a triangle
ZERO, HALF, ONE, FAR_OFF = f32(0.0), f32(0.5), f32(1.0), f32(1e9)
Corners = Floats  # (N, 3, 3): triangle, corner, clip coordinates


@compiled
def rasterise(corners: Corners, n: int, depths: Floats, shown: Integers, polygon: Floats) -> None:
    """Draws the first n triangles into depths, 1/w of what is nearest, and shown, its number: (rows, columns) each.
    polygon: room (POLYGON, 4) for the corners of what is left of one.

    Triangles count where their corners go around counter-clockwise in the picture; the others show their backs.
    """
    depths[:] = ZERO
    shown[:] = i32(NOTHING)
    rows, columns = depths.shape
    for triangle in range(n):
        corner = corners[triangle]
        size = clipped(corner, polygon)
        if size == 0:
            continue
        in_samples(polygon, size, columns, rows)
        _fill(polygon, size, triangle, depths, shown)


@inlined
def clipped(corner: Floats, polygon: Floats) -> int:
    """Writes the part of a convex polygon (M, 3) that lies beyond the near plane; returns its corners, up to M + 1."""
    size, corners = 0, len(corner)
    for k in range(corners):
        this, following = corner[k], corner[k + 1 if k + 1 < corners else 0]
        if this[2] > NEAR:
            for axis in range(3):
                polygon[size, axis] = this[axis]
            size += 1
        if (this[2] > NEAR) != (following[2] > NEAR):
            share = (NEAR - this[2]) / (following[2] - this[2])
            polygon[size, 0] = this[0] + share * (following[0] - this[0])
            polygon[size, 1] = this[1] + share * (following[1] - this[1])
            polygon[size, 2] = NEAR
            size += 1
    return size


@inlined
def in_samples(polygon: Floats, size: int, columns: int, rows: int) -> None:
    """Turns clip coordinates of a polygon's corners into columns and rows of samples, and 1/w. Beside each corner it
    writes by how many columns the edge to the next moves on from row to row."""
    half_width, half_height = f32(columns) * HALF, f32(rows) * HALF
    for k in range(size):
        inverse = ONE / polygon[k, 2]
        polygon[k, 0] = polygon[k, 0] * inverse * half_width + half_width - HALF
        polygon[k, 1] = polygon[k, 1] * inverse * half_height + half_height - HALF
        polygon[k, 2] = inverse
    for k in range(size):
        following = k + 1 if k + 1 < size else 0
        polygon[k, SLOPE] = (polygon[following, 0] - polygon[k, 0]) / (polygon[following, 1] - polygon[k, 1])


@inlined
def _fill(polygon: Floats, size: int, number: int, depths: Floats, shown: Integers) -> None:
    """Draws a convex polygon: corners (columns, rows, 1/w) in samples, counter-clockwise."""
    rows, columns = depths.shape
    left, right, top, bottom = FAR_OFF, -FAR_OFF, FAR_OFF, -FAR_OFF
    for k in range(size):
        left, right = min(left, polygon[k, 0]), max(right, polygon[k, 0])
        top, bottom = min(top, polygon[k, 1]), max(bottom, polygon[k, 1])
    if right < ZERO or left > f32(columns - 1) or bottom < ZERO or top > f32(rows - 1):
        return
    first, last = i32(np.ceil(max(ZERO, top))), i32(np.floor(min(f32(rows - 1), bottom)))
    if first > last:
        return
    ax, ay, az = polygon[1, 0] - polygon[0, 0], polygon[1, 1] - polygon[0, 1], polygon[1, 2] - polygon[0, 2]
    bx, by, bz = polygon[2, 0] - polygon[0, 0], polygon[2, 1] - polygon[0, 1], polygon[2, 2] - polygon[0, 2]
    area = ax * by - ay * bx
    if area >= ZERO:
        return
    across, down = (az * by - bz * ay) / area, (bz * ax - az * bx) / area
    start = polygon[0, 2] - across * polygon[0, 0] - down * polygon[0, 1]
    for row in range(first, last + 1):
        begin, end = span(polygon, size, f32(row), columns)
        depth, nearest, numbers = start + down * f32(row), depths[row, begin:end], shown[row, begin:end]
        for k in range(end - begin):  # without a branch several samples are compared at once
            z = depth + across * f32(i32(begin + k))
            is_nearer = z > nearest[k]
            nearest[k] = z if is_nearer else nearest[k]
            numbers[k] = i32(number) if is_nearer else numbers[k]


@inlined
def span(polygon: Floats, size: int, row: np.float32, columns: int) -> tuple[int, int]:
    """First column of a convex polygon in a row, and the one after its last. Edges that two polygons share are computed
    from the same end, so that nothing shows between them."""
    low, high = FAR_OFF, -FAR_OFF
    for k in range(size):
        following = k + 1 if k + 1 < size else 0
        if (polygon[k, 1] <= row) != (polygon[following, 1] <= row):
            upper = k if polygon[k, 1] < polygon[following, 1] else following
            crossing = polygon[upper, 0] + (row - polygon[upper, 1]) * polygon[k, SLOPE]
            low, high = min(low, crossing), max(high, crossing)
    return int(np.ceil(max(ZERO, low))), int(np.ceil(min(f32(columns), high)))
