"""Fragments: each triangle that a pixel shows is shaded once there, where its samples lie, and counts by their share.

What a triangle carries from corner to corner is linear over a picture once it is divided by w: such a plane holds for
all of its fragments.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from caldrive.compiled import Floats, Integers, compiled, f32, i32

SAMPLES = 2  # samples of a pixel along each side
QUARTER, HALF, ONE = f32(0.25), f32(0.5), f32(1.0)
TAKEN = -2  # a sample that another fragment has counted


class Fragments(NamedTuple):
    """N fragments, in the order of their pixels."""

    column: Floats
    """(N,) in pixels, 0 in the middle of the first."""
    row: Floats
    """(N,) likewise."""
    triangle: Integers
    """(N,): which one it shows, as a number of the triangles shown."""
    pixel: Integers
    """(N,): row times the picture's width plus column."""
    share: Floats
    """(N,) of its pixel."""
    samples: Integers
    """(4,): room for a pixel's triangles."""


def room_for(pixels: int) -> Fragments:
    """Room for the fragments of so many pixels."""
    n = SAMPLES * SAMPLES * pixels
    column, row, share = (np.empty(n, np.float32) for _ in range(3))
    return Fragments(column, row, np.empty(n, np.int32), np.empty(n, np.int32), share, np.empty(4, np.int32))


@compiled
def seen(shown: Integers, n: int, order: Integers, triangles: Integers) -> int:
    """Writes which of n triangles samples (rows, columns) show, in their order, and returns how many; the samples take
    on their numbers in that order. order: room for n."""
    for k in range(n):
        order[k] = i32(-1)
    for row in range(shown.shape[0]):
        for column in range(shown.shape[1]):
            if shown[row, column] >= 0:
                order[shown[row, column]] = i32(0)
    many = 0
    for k in range(n):
        if order[k] == 0:
            order[k], triangles[many] = i32(many), i32(k)
            many += 1
    for row in range(shown.shape[0]):
        for column in range(shown.shape[1]):
            if shown[row, column] >= 0:
                shown[row, column] = order[shown[row, column]]
    return many


@compiled
def make_planes(corners: Floats, values: Floats, width: int, height: int, planes: Floats) -> None:
    """Writes planes (3 + 3 K,) of a triangle: of 1/w, and of K values over w: what each is at pixel (0, 0), and what a
    column and a row add.

    corners: clip coordinates (3, 3), of its first three corners; values: (3, K) there.
    """
    x0, y0, w0 = corners[0, 0], corners[0, 1], corners[0, 2]
    x1, y1, w1 = corners[1, 0], corners[1, 1], corners[1, 2]
    x2, y2, w2 = corners[2, 0], corners[2, 1], corners[2, 2]
    ax, ay, az = y1 * w2 - y2 * w1, x2 * w1 - x1 * w2, x1 * y2 - x2 * y1
    bx, by, bz = y2 * w0 - y0 * w2, x0 * w2 - x2 * w0, x2 * y0 - x0 * y2
    cx, cy, cz = y0 * w1 - y1 * w0, x1 * w0 - x0 * w1, x0 * y1 - x1 * y0
    volume = ONE / (x0 * ax + y0 * ay + w0 * az)
    to_x, to_y = f32(2.0) / f32(width), f32(2.0) / f32(height)
    for k in range(len(planes) // 3):
        a, b, c = ONE, ONE, ONE
        if k > 0:
            a, b, c = values[0, k - 1], values[1, k - 1], values[2, k - 1]
        along_x, along_y = (ax * a + bx * b + cx * c) * volume, (ay * a + by * b + cy * c) * volume
        start = (az * a + bz * b + cz * c) * volume
        planes[3 * k] = start + along_x * (HALF * to_x - ONE) + along_y * (HALF * to_y - ONE)
        planes[3 * k + 1], planes[3 * k + 2] = along_x * to_x, along_y * to_y


@compiled
def fragments_of(shown: Integers, first: int, last: int, room: Fragments) -> int:
    """Writes the fragments of pixel rows first to last - 1; returns how many. shown: (rows, columns) of samples."""
    columns = shown.shape[1] // 2
    numbers, n = room.samples, 0
    for row in range(first, last):
        upper, lower = shown[2 * row], shown[2 * row + 1]
        for column in range(columns):
            a = upper[2 * column]
            if upper[2 * column + 1] == a and lower[2 * column] == a and lower[2 * column + 1] == a:
                if a >= 0:
                    room.column[n], room.row[n], room.share[n] = f32(column), f32(row), ONE
                    room.triangle[n], room.pixel[n] = a, row * columns + column
                    n += 1
                continue
            numbers[0], numbers[1] = a, upper[2 * column + 1]
            numbers[2], numbers[3] = lower[2 * column], lower[2 * column + 1]
            for k in range(4):
                if numbers[k] < 0:
                    continue
                a, samples, right, below = numbers[k], f32(0.0), f32(0.0), f32(0.0)
                for j in range(k, 4):
                    if numbers[j] == a:
                        samples += ONE
                        right += f32(j & 1) - HALF
                        below += f32(j >> 1) - HALF
                        numbers[j] = TAKEN
                room.column[n], room.row[n] = f32(column) + HALF * right / samples, f32(row) + HALF * below / samples
                room.triangle[n], room.pixel[n], room.share[n] = a, row * columns + column, samples * QUARTER
                n += 1
    return n
