"""What stands in a town: buildings, trees, posts and street furniture, as a pure function of the road network.

The same town gives the same props in every process: all randomness is seeded from the town's name.
"""

from __future__ import annotations

import math
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray

from caldrive.datatypes import Points, Pose
from caldrive.world.roads.network import SIDEWALK_WIDTH, RoadNetwork
from caldrive.world.scene.decor import N_VARIANTS, Decor, Furniture, Style
from caldrive.world.scene.domain_randomisation import N_DESIGNS, randomised_decor, shown_signs

SETBACK = 1.4  # m from the sidewalk to a façade
PUSHED_BACK = (0.0, 1.0, 2.5)  # m more where a bend leaves too little room
TREE_LINE = 2.6  # m from the kerb: the sidewalk's outer third
LAMP_LINE = 0.55
CLEAR_OF_POSTS = 6.5  # m around lights and signs without trees, which would hide them
Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Prop:
    """A thing that stands still: pose of its centre, its solid box in metres, and which of its kind it is.

    A building's heading looks at the road. A tree's box is its trunk, its height includes the crown. label: the limit
    on a speed sign, else 0.
    """

    kind: str
    pose: Pose
    length: float
    width: float
    height: float
    variant: int = 0
    label: int = 0
    solid: bool = True


_SIZES = {  # length (towards the road), width, height in metres
    "lamp": (0.2, 0.2, 6.2), "bin": (0.45, 0.45, 0.95), "bench": (0.55, 1.7, 0.85), "hydrant": (0.3, 0.3, 0.75),
    "box": (0.5, 0.9, 1.25), "hedge": (0.9, 7.0, 1.3), "fence": (0.15, 8.0, 1.5), "wall": (0.3, 8.0, 2.0),
    "container": (2.4, 6.0, 2.6), "billboard": (0.4, 4.6, 4.4),
}  # fmt: skip


def _size(kind: str, variant: int, furniture: Furniture) -> tuple[float, float, float]:
    """Length, width and height of a kind of furniture."""
    odd = furniture.oddment(kind, variant)
    return (odd.length, odd.width, odd.height) if odd else _SIZES[kind]


class _Line:
    """A closed line at a fixed distance from the roadway, walked with the road on its left."""

    def __init__(self, ring: shapely.LinearRing) -> None:
        self.points: Points = shapely.get_coordinates(ring)
        steps = np.diff(self.points, axis=0)
        self.s = np.concatenate(([0.0], np.cumsum(np.linalg.norm(steps, axis=1))))
        self.length = float(self.s[-1])

    def at(self, s: Floats) -> Points:
        return np.stack([np.interp(s, self.s, self.points[:, k]) for k in (0, 1)], axis=1)

    def places(self, s: Floats, reach: Floats) -> tuple[Points, Floats]:
        """Middles (N, 2) of the chords from s - reach to s + reach, and headings (N,) that look away from the road."""
        a, b = self.at(np.maximum(s - reach, 0)), self.at(np.minimum(s + reach, self.length))
        d = b - a
        return (a + b) / 2, np.arctan2(-d[:, 0], d[:, 1])


def _lines(roads: RoadNetwork, distance: float) -> list[_Line]:
    parts = shapely.get_parts(shapely.orient_polygons(roads.roadway.buffer(distance)))
    return [_Line(ring) for p in parts for ring in (p.exterior, *p.interiors) if ring.length > 20]


def _beyond(points: Points, outward: Floats, distance: Floats) -> Points:
    return np.asarray(points + distance[:, None] * np.stack((np.cos(outward), np.sin(outward)), axis=1))


def _facing_road(at: Points, outward: float) -> Pose:
    return Pose(float(at[0]), float(at[1]), float(outward) + math.pi)


def _boxes(center: Points, heading: Floats, length: Floats, width: Floats) -> NDArray[np.object_]:
    """Oriented rectangles as shapely polygons."""
    ahead = np.stack((np.cos(heading), np.sin(heading)), axis=1) * length[:, None] / 2
    left = np.stack((-np.sin(heading), np.cos(heading)), axis=1) * width[:, None] / 2
    ring = np.stack((ahead + left, left - ahead, -ahead - left, ahead - left), axis=1) + center[:, None]
    return np.asarray(shapely.polygons(ring))


def _without_overlaps(shapes: NDArray[np.object_]) -> NDArray[np.bool_]:
    """Which shapes to keep so that none overlaps an earlier one."""
    keep = np.ones(len(shapes), dtype=bool)
    tree = shapely.STRtree(shapes)
    for i, j in sorted(zip(*tree.query(shapes, predicate="intersects").tolist(), strict=True)):
        if i < j and keep[i]:
            keep[j] = False
    return keep


def _walk(length: float, least: float, most: float, rng: np.random.Generator) -> Floats:
    """Sizes of plots that fill a length one after the other."""
    sizes = rng.uniform(least, most, int(length / least) + 1)
    return sizes[np.cumsum(sizes) <= length]


def _plots(roads: RoadNetwork, style: Style, rng: np.random.Generator) -> tuple[Points, Floats, Floats]:
    """Middles of the plots' street sides, headings away from the road, and frontages."""
    found = []
    for line in _lines(roads, SIDEWALK_WIDTH + SETBACK):
        width = _walk(line.length, *style.frontage, rng)
        found.append((*line.places(np.cumsum(width) - width / 2, width / 2), width))
    middles, outward, width = (np.concatenate(parts) for parts in zip(*found, strict=True))
    return middles, outward, width


def _buildings(roads: RoadNetwork, decor: Decor, rng: np.random.Generator) -> Iterator[Prop]:
    """Houses on their plots, and what stands in the gaps between them."""
    style = decor.style
    middles, outward, frontage = _plots(roads, style, rng)
    n = len(frontage)
    width, depth = frontage - rng.uniform(0.1, 0.9, n), rng.uniform(*style.depth, n)
    built = rng.random(n) >= style.gap
    floors, variant = rng.integers(style.floors[0], style.floors[1] + 1, n), rng.integers(N_DESIGNS, size=n)
    keep_off = roads.roadway.buffer(SIDEWALK_WIDTH + 1.0)
    shapely.prepare(keep_off)
    center, fits = np.zeros((n, 2)), np.zeros(n, dtype=bool)
    for back in PUSHED_BACK:
        tried = _beyond(middles, outward, depth / 2 + back)
        free = ~fits & ~shapely.intersects(keep_off, _boxes(tried, outward, depth, width))
        center[free] = tried[free]
        fits |= free
    chosen = np.flatnonzero(built & fits)
    chosen = chosen[_without_overlaps(_boxes(center[chosen], outward[chosen], depth[chosen], width[chosen]))]
    for i in chosen:
        pose = _facing_road(center[i], outward[i])
        yield Prop("building", pose, float(depth[i]), float(width[i]), float(floors[i] * style.floor), int(variant[i]))
    houses = _boxes(center[chosen], outward[chosen], depth[chosen] + 0.5, width[chosen] + 0.5)
    empty = np.setdiff1d(np.arange(n), chosen)
    yield from _in_gaps(middles[empty], outward[empty], shapely.union_all(houses), keep_off, decor, rng)


def _in_gaps(
    at: Points,
    outward: Floats,
    houses: shapely.Geometry,
    keep_off: shapely.Geometry,
    decor: Decor,
    rng: np.random.Generator,
) -> Iterator[Prop]:
    choice = decor.style.in_gaps
    kinds = [choice[k] for k in rng.integers(len(choice), size=len(at))]
    sizes = tuple(_size(kind, 0, decor.furniture) for kind in kinds)
    length, width, _ = np.array(sizes).reshape(-1, 3).T
    center = _beyond(at, outward, length / 2 + 0.3)
    shapes = _boxes(center, outward, length, width)
    free = ~shapely.intersects(houses, shapes) & ~shapely.intersects(keep_off, shapes)
    for i in np.flatnonzero(free)[_without_overlaps(shapes[free])]:
        pose = _facing_road(center[i], outward[i])
        yield Prop(kinds[i], pose, *sizes[int(i)], int(rng.integers(N_VARIANTS)))


def _along(
    roads: RoadNetwork, distance: float, gap: tuple[float, float], rng: np.random.Generator
) -> tuple[Points, Floats]:
    found = []
    for line in _lines(roads, distance):
        s = np.cumsum(_walk(line.length - gap[0] / 2, *gap, rng))
        found.append(line.places(s, np.full(len(s), 0.4)))
    at, outward = (np.concatenate(parts) for parts in zip(*found, strict=True))
    return at, outward


def _clear(at: Points, props: Sequence[Prop], distance: float) -> NDArray[np.bool_]:
    """Which points lie further than a distance from all props' centres."""
    others = np.array([(p.pose.x, p.pose.y) for p in props]).reshape(-1, 2)
    gaps = np.hypot(*(at[:, None] - others).transpose(2, 0, 1))
    return np.asarray((gaps > distance).all(1))


def _trees(roads: RoadNetwork, style: Style, posts: Sequence[Prop], rng: np.random.Generator) -> Iterator[Prop]:
    at, outward = _along(roads, TREE_LINE, style.tree_gap, rng)
    heights, variants = rng.uniform(*style.tree_height, len(at)), rng.integers(3, size=len(at))
    for i in np.flatnonzero(_clear(at, posts, CLEAR_OF_POSTS)):
        pose = _facing_road(at[i], outward[i])
        yield Prop("tree", pose, 0.4, 0.4, float(heights[i]), int(variants[i]))


def _furniture(
    roads: RoadNetwork, posts: Sequence[Prop], trees: Sequence[Prop], look: Furniture, rng: np.random.Generator
) -> Iterator[Prop]:
    """Street lamps along the kerb, well away from posts; small things at the back of the sidewalk."""
    small = ("bin", "bench", "hydrant", "box", *("oddment" for _ in look.oddments))
    for distance, gap, kinds, clear in ((LAMP_LINE, (22, 30), ("lamp",), 12.0), (TREE_LINE, look.gap, small, 2.5)):
        at, outward = _along(roads, distance, gap, rng)
        chosen = rng.integers(len(kinds), size=len(at))
        for i in np.flatnonzero(_clear(at, posts, clear) & _clear(at, trees, 2.5)):
            pose = _facing_road(at[i], outward[i])
            kind, variant = kinds[chosen[i]], int(rng.integers(N_VARIANTS))
            yield Prop(kind, pose, *_size(kind, variant, look), variant)


def _posts(roads: RoadNetwork, appearance: int) -> Iterator[Prop]:
    for post in roads.posts:
        yield Prop("light_post", post.pose, 0.2, 0.2, 3.5)
    for sign in shown_signs(roads.signs, appearance):
        yield Prop("sign_post", sign.pose, 0.2, 0.2, 2.5, label=sign.limit)


def build_scenery(roads: RoadNetwork, appearance: int = 0) -> tuple[Prop, ...]:
    """All props of a town: posts first, then buildings, trees and furniture.

    appearance: 0 is the town as it is; others have the same streets and posts among other houses and trees, and other
    limits on the fast ones.
    """
    rng = np.random.default_rng([zlib.crc32(roads.name.encode()), *([appearance] if appearance else [])])
    decor = randomised_decor(roads.style, appearance)
    posts = tuple(_posts(roads, appearance))
    buildings = tuple(_buildings(roads, decor, rng))
    trees = tuple(_trees(roads, decor.style, posts, rng))
    return (*posts, *buildings, *trees, *_furniture(roads, posts, trees, decor.furniture, rng))
