"""Where the client's crowd may walk: the sidewalks as a navigation mesh, in the file format of Recast and Detour.

The file holds one tile of quadrilaterals along the middle of each sidewalk. Its axes are CARLA's in another order: x,
height, y.
"""

from __future__ import annotations

import struct
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from caldrive.world.roads.network import SIDEWALK_WIDTH, RoadNetwork
from caldrive.world.traffic.sidewalks import find_sidewalks

LENGTH = 2.0  # m of a quadrilateral, about
HALF_WIDTH = SIDEWALK_WIDTH / 2 - 0.3  # m
MOST_QUADS = 30_000  # the format counts corners in 16 bits
SIDEWALK = (2, 1)  # flags and area of a polygon
SET_HEAD = struct.Struct("<3i3f2f2iIi")
TILE_HEAD = struct.Struct("<15i3f3f3ff")
MAGIC, SET_VERSION = 0x4D534554, 1
TILE_MAGIC, TILE_VERSION = 0x444E4156, 7
PERSON = (1.8, 0.3, 0.4)  # m: height, radius and the step that they climb
NO_LINK, NOBODY = 0xFFFFFFFF, 0
POLYGON = struct.Struct("<I6H6HHBB")
LINKS, LINK_SIZE = 4, 12  # of each quadrilateral, and bytes of one
DETAIL = struct.pack("<IIBB2x", 0, 0, 0, 2)  # two triangles without corners of their own
TRIANGLES = bytes((0, 1, 2, 0b000101, 0, 2, 3, 0b010100))  # corners, and which edges are the quadrilateral's own


@lru_cache(maxsize=2)
def navigation_mesh(roads: RoadNetwork) -> bytes:
    """The file for a town; empty where it has no sidewalks, or too many for one tile."""
    rings = [_ring(places) for places in _loops(roads)]
    n = sum(len(ring) for ring in rings)
    if not 0 < n <= MOST_QUADS:
        return b""
    corners = np.concatenate([ring.reshape(-1, 2) for ring in rings])
    polygons, first = [], 0
    for ring in rings:
        polygons += [_polygon(first, k, len(ring)) for k in range(len(ring))]
        first += len(ring)
    return _file(corners, polygons)


def _loops(roads: RoadNetwork) -> list[NDArray[np.float64]]:
    """x, y, heading (N, 3) along the middle of each sidewalk."""
    loops = find_sidewalks(roads).loops
    found = []
    for length, first in zip(loops.lengths, loops.first, strict=True):
        n = max(3, round(length / LENGTH))
        found.append(loops.table[first + (np.arange(n) * length / n / loops.grain).astype(int)])
    return found


def _ring(places: NDArray[np.float64]) -> NDArray[np.float64]:
    """The left and the right edge of a sidewalk (N, 2, 2) at some places, in our axes."""
    left = np.stack((-np.sin(places[:, 2]), np.cos(places[:, 2])), axis=1)
    return np.stack((places[:, :2] + HALF_WIDTH * left, places[:, :2] - HALF_WIDTH * left), axis=1)


def _polygon(first: int, k: int, n: int) -> bytes:
    """The k-th of the n quadrilaterals of a ring, whose first one has a number. Its corners go around counter-clockwise
    in our axes, its second edge leads nowhere, and its last one neither."""
    here, following, before = first + k, first + (k + 1) % n, first + (k - 1) % n
    corners = (2 * here, 2 * here + 1, 2 * following + 1, 2 * following, 0, 0)
    neighbours = (before + 1, NOBODY, following + 1, NOBODY, 0, 0)
    flags, area = SIDEWALK
    return POLYGON.pack(NO_LINK, *corners, *neighbours, flags, 4, area)


def _file(corners: NDArray[np.float64], polygons: list[bytes]) -> bytes:
    """The tile, and what stands before it."""
    n = len(polygons)
    points = np.column_stack((corners[:, 0], np.zeros(len(corners)), -corners[:, 1])).astype("<f4")
    low, high = points.min(axis=0) - 1.0, points.max(axis=0) + 3.0
    counts = (n, len(points), LINKS * n, n, 0, 2 * n, 0, 0, n)
    tile = b"".join((
        TILE_HEAD.pack(TILE_MAGIC, TILE_VERSION, 0, 0, 0, 0, *counts, *PERSON, *low, *high, 1.0),
        points.tobytes(), *polygons, bytes(LINK_SIZE * LINKS * n), DETAIL * n, TRIANGLES * n,
    ))  # fmt: skip
    bits = max(1, (n - 1).bit_length())
    size = (float(high[0] - low[0]), float(high[2] - low[2]))
    head = SET_HEAD.pack(MAGIC, SET_VERSION, 1, *low, *size, 1, 2**bits, 1 << bits, len(tile))
    return head + tile
