"""What stands in a town: buildings, trees, posts and street furniture, as a pure function of the road network.

The same town gives the same props in every process: all randomness is seeded from the town's name.
"""

from __future__ import annotations

import math
import zlib
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import shapely

from caldrive.datatypes import Points, Pose
from caldrive.geometry import box_corners
from caldrive.world.roads import SIDEWALK_WIDTH, RoadNetwork

SETBACK = 1.3  # m from the sidewalk to a façade, at least 1 m after rounding at corners
TREE_LINE = 2.5  # m from the kerb: the sidewalk's outer third
LAMP_LINE = 0.55  # m from the kerb


@dataclass(frozen=True)
class Prop:
    """A thing that stands still: pose of its centre, its solid box in metres, and which of its kind it is.

    label: the limit on a speed sign, else 0. A tree's box is its trunk, its height includes the crown.
    """

    kind: str
    pose: Pose
    length: float
    width: float
    height: float
    variant: int = 0
    label: int = 0
    solid: bool = True


@dataclass(frozen=True)
class Style:
    """Sizes of what lines the streets. frontage, depth, height, tree_gap: (least, most) metres; gap: share of empty plots."""

    buildings: int
    frontage: tuple[float, float]
    depth: tuple[float, float]
    floors: tuple[int, int]
    floor: float
    gap: float
    trees: int
    tree_gap: tuple[float, float]
    tree_height: tuple[float, float]


STYLES = {
    "town01": Style(6, (9, 17), (9, 13), (2, 4), 3.1, 0.16, 2, (9, 18), (5.5, 8.0)),
    "town02": Style(5, (13, 26), (10, 15), (2, 7), 3.4, 0.28, 2, (12, 26), (6.0, 9.0)),
}


@dataclass(frozen=True)
class _Place:
    """A point on a line beside the road: s along the line, and the heading that looks away from the road."""

    s: float
    x: float
    y: float
    outward: float


class _Kerb:
    """A closed line at a fixed distance from the roadway, walked with the road on the left."""

    def __init__(self, ring: shapely.LinearRing) -> None:
        self.points = shapely.get_coordinates(ring)
        steps = np.diff(self.points, axis=0)
        self.s = np.concatenate(([0.0], np.cumsum(np.linalg.norm(steps, axis=1))))

    def at(self, s: float) -> tuple[float, float]:
        return float(np.interp(s, self.s, self.points[:, 0])), float(np.interp(s, self.s, self.points[:, 1]))

    def place(self, s: float, reach: float = 0.5) -> _Place:
        """The place at s; its heading is perpendicular to the chord from s - reach to s + reach."""
        (x0, y0), (x1, y1) = self.at(max(s - reach, 0.0)), self.at(min(s + reach, self.s[-1]))
        x, y = (x0 + x1) / 2, (y0 + y1) / 2
        return _Place(s, x, y, math.atan2(x0 - x1, y1 - y0))


def _kerbs(roads: RoadNetwork, distance: float) -> list[_Kerb]:
    area = roads.roadway.buffer(distance)
    parts = shapely.get_parts(area)
    rings = [ring for p in parts for ring in (shapely.orient_polygons(p).exterior, *shapely.orient_polygons(p).interiors)]
    return [_Kerb(ring) for ring in rings if ring.length > 20]


def _outward(place: _Place, distance: float) -> tuple[float, float]:
    return place.x + distance * math.cos(place.outward), place.y + distance * math.sin(place.outward)


def _buildings(roads: RoadNetwork, style: Style, rng: np.random.Generator) -> Iterator[Prop]:
    keep_off = roads.roadway.buffer(SIDEWALK_WIDTH + 1.0)
    shapely.prepare(keep_off)
    taken: list[Points] = []
    for kerb in _kerbs(roads, SIDEWALK_WIDTH + SETBACK):
        s = float(rng.uniform(0, 6))
        while s < kerb.s[-1] - style.frontage[0]:
            width, depth = rng.uniform(*style.frontage), rng.uniform(*style.depth)
            floors, variant = int(rng.integers(style.floors[0], style.floors[1] + 1)), int(rng.integers(style.buildings))
            free = rng.random() >= style.gap
            place = kerb.place(s + width / 2, width / 2)
            pose = _first_free(place, width, depth, keep_off, taken) if free else None
            if pose is not None:
                taken.append(np.array([pose.x, pose.y, math.hypot(depth, width) / 2]))
                yield Prop("building", pose, depth, width, floors * style.floor, variant)
            s += width + float(rng.uniform(0.0, 0.8)) if pose is not None or not free else 2.0


def _first_free(
    place: _Place, width: float, depth: float, keep_off: shapely.Geometry, taken: list[Points]
) -> Pose | None:
    """Where a building fits behind the kerb, pushed back a little on bends; the heading looks at the road."""
    for back in (0.0, 0.8, 2.0):
        pose = Pose(*_outward(place, depth / 2 + back), place.outward + math.pi)
        corners = box_corners(pose, depth, width)
        if keep_off.intersects(shapely.Polygon(corners)):
            continue
        near = [t for t in taken if math.hypot(t[0] - pose.x, t[1] - pose.y) < t[2] + math.hypot(depth, width) / 2]
        if not near:
            return pose
    return None


def _posts(roads: RoadNetwork) -> Iterator[Prop]:
    for post in roads.posts:
        yield Prop("light_post", post.pose, 0.2, 0.2, 3.4)
    for sign in roads.signs:
        yield Prop("sign_post", sign.pose, 0.2, 0.2, 2.5, label=sign.limit)


def build_scenery(roads: RoadNetwork) -> tuple[Prop, ...]:
    """All props of a town: posts first, then buildings, trees and furniture."""
    rng = np.random.default_rng(zlib.crc32(roads.name.encode()))
    style = STYLES.get(roads.style, STYLES["town01"])
    return (*_posts(roads), *_buildings(roads, style, rng))
