"""Where things can stand beside the streets: closed lines along the roadway, places on them, and boxes that stay clear.

Everything here is arrays: N places at once.
"""

from __future__ import annotations

import numpy as np
import shapely
from numpy.typing import NDArray
from scipy.spatial import KDTree

from caldrive.datatypes import Points
from caldrive.geometry import Polyline
from caldrive.world.roads.network import RoadNetwork, rings

SHORTEST = 20.0  # m; shorter lines go around nothing that anything could stand beside
Floats = NDArray[np.float64]
Shapes = NDArray[np.object_]  # of shapely's


def kerb_lines(roads: RoadNetwork, distance: float) -> list[Polyline]:
    """The closed lines around a town's roadway and around every block, so many metres beside it, walked with the road
    on their left."""
    around = rings(shapely.orient_polygons(roads.roadway.buffer(distance)))
    return [Polyline(shapely.get_coordinates(ring)) for ring in around if ring.length > SHORTEST]


def chords(line: Polyline, s: Floats, reach: Floats) -> tuple[Points, Floats]:
    """Middles (N, 2) of the chords of a kerb line from s - reach to s + reach, and headings (N,) that look away from
    the road."""
    start, end = line.points_at(np.maximum(s - reach, 0)), line.points_at(np.minimum(s + reach, line.length))
    chord = end - start
    return (start + end) / 2, np.arctan2(-chord[:, 0], chord[:, 1])


def random_lengths(total: float, least: float, most: float, rng: np.random.Generator) -> Floats:
    """Lengths (N,) between least and most that fill a total one after the other, all in m."""
    lengths = rng.uniform(least, most, int(total / least) + 1)
    return lengths[np.cumsum(lengths) <= total]


def places_along(
    roads: RoadNetwork, distance: float, spacing: tuple[float, float], rng: np.random.Generator
) -> tuple[Points, Floats]:
    """Places (N, 2) so many metres beside the roadway, with random gaps between least and most of a spacing, and their
    headings (N,) away from the road."""
    parts = [(np.zeros((0, 2)), np.zeros(0))]  # a town may be too small for any
    for line in kerb_lines(roads, distance):
        s = np.cumsum(random_lengths(line.length - spacing[0] / 2, *spacing, rng))
        parts.append(chords(line, s, np.full(len(s), 0.4)))
    places, outward = (np.concatenate(arrays) for arrays in zip(*parts, strict=True))
    return places, outward


def beyond(places: Points, outward: Floats, distance: Floats) -> Points:
    """The places (N, 2) so many metres (N,) further along their headings (N,)."""
    return np.asarray(places + distance[:, None] * np.stack((np.cos(outward), np.sin(outward)), axis=1))


def box_shapes(center: Points, heading: Floats, length: Floats, width: Floats) -> Shapes:
    """Oriented rectangles (N,) as shapely polygons."""
    ahead = np.stack((np.cos(heading), np.sin(heading)), axis=1) * length[:, None] / 2
    left = np.stack((-np.sin(heading), np.cos(heading)), axis=1) * width[:, None] / 2
    ring = np.stack((ahead + left, left - ahead, -ahead - left, ahead - left), axis=1) + center[:, None]
    return np.asarray(shapely.polygons(ring))


def without_overlaps(shapes: Shapes) -> NDArray[np.bool_]:
    """Which shapes (N,) to keep so that none overlaps an earlier one."""
    keep = np.ones(len(shapes), dtype=bool)
    tree = shapely.STRtree(shapes)
    for i, j in sorted(zip(*tree.query(shapes, predicate="intersects").tolist(), strict=True)):
        if i < j and keep[i]:
            keep[j] = False
    return keep


def clear_of(places: Points, centers: Points, distance: float) -> NDArray[np.bool_]:
    """Which places (N, 2) lie further than a distance (m) from all centres (M, 2)."""
    # A table of all distances would need gigabytes for a large map.
    gaps, _ = KDTree(centers).query(places)
    return np.asarray(gaps > distance)
