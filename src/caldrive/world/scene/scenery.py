"""What stands in a town: buildings, trees, posts and street furniture, as a pure function of the road network.

The same town in the same appearance gets the same props in every process: all randomness is seeded from its name and
the appearance's number.
"""

from __future__ import annotations

import math
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray

from caldrive.datatypes import Points, Pose, Sign
from caldrive.geometry import positions
from caldrive.world.roads.network import SIDEWALK_WIDTH, RoadNetwork
from caldrive.world.scene.appearance import N_BUILDING_TYPES, N_VARIANTS, Appearance, StreetFurniture, StreetLayout
from caldrive.world.scene.kerb_lines import (
    Floats,
    beyond,
    box_shapes,
    chords,
    clear_of,
    kerb_lines,
    places_along,
    random_lengths,
    without_overlaps,
)

SHORTEST_BLOCK = 80.0  # m around it; on smaller ones, such as a roundabout's island, stands no house
SETBACK = 1.4  # m from the sidewalk to a façade
PUSHED_BACK = (0.0, 1.0, 2.5)  # m more where a bend leaves too little room
HOUSE_CLEARANCE = 1.0  # m from the sidewalk that stay free of houses
TREE_LINE = 2.6  # m from the kerb: the sidewalk's outer third
LAMP_LINE = 0.55  # m from the kerb
LAMP_SPACING = (22, 30)  # m
CLEAR_OF_POSTS = 6.5  # m around lights and signs without trees, which would hide them
LAMP_CLEAR_OF_POSTS, FURNITURE_CLEAR_OF_POSTS, CLEAR_OF_TREES = 12.0, 2.5, 2.5  # m


@dataclass(frozen=True)
class Prop:
    """A thing that stands still."""

    kind: str
    """Such as building, tree, light_post, sign_post or one of the kinds of street furniture."""
    pose: Pose
    """Of its centre. A building looks at the road."""
    length: float
    """m along its heading. A tree's box is its trunk."""
    width: float
    """m across its heading."""
    height: float
    """m, a tree's with its crown."""
    variant: int = 0
    """Which of its kind it is."""
    limit: int = 0
    """km/h on a speed sign, else 0."""


# Length (towards the road), width, height in m
_SIZES = {
    "lamp": (0.2, 0.2, 6.2), "bin": (0.45, 0.45, 0.95), "bench": (0.55, 1.7, 0.85), "hydrant": (0.3, 0.3, 0.75),
    "box": (0.5, 0.9, 1.25), "hedge": (0.9, 7.0, 1.3), "fence": (0.15, 8.0, 1.5), "wall": (0.3, 8.0, 2.0),
    "container": (2.4, 6.0, 2.6), "billboard": (0.4, 4.6, 4.4),
}  # fmt: skip
SMALL_THINGS = ("bin", "bench", "hydrant", "box")


def build_scenery(roads: RoadNetwork, signs: Sequence[Sign], appearance: Appearance) -> tuple[Prop, ...]:
    """All props of a town: posts first, then buildings, trees and furniture. signs: as they are in this appearance."""
    number = appearance.number
    rng = np.random.default_rng([zlib.crc32(roads.name.encode()), *([number] if number else [])])
    posts = tuple(_posts(roads, signs))
    buildings = tuple(_buildings(roads, appearance, rng))
    trees = tuple(_trees(roads, appearance.layout, posts, rng))
    return (*posts, *buildings, *trees, *_furniture(roads, posts, trees, appearance.furniture, rng))


def _posts(roads: RoadNetwork, signs: Sequence[Sign]) -> Iterator[Prop]:
    """One post for all lanes of an approach."""
    for foot in dict.fromkeys(post.stands_at for post in roads.posts):
        yield Prop("light_post", foot, length=0.2, width=0.2, height=3.5)
    for foot, limit in {sign.stands_at: sign.limit for sign in signs}.items():
        yield Prop("sign_post", foot, length=0.2, width=0.2, height=2.5, limit=limit)


def _plots(roads: RoadNetwork, layout: StreetLayout, rng: np.random.Generator) -> tuple[Points, Floats, Floats]:
    """Middles (N, 2) of the plots' street sides, headings (N,) away from the road, and frontages (N,) in m."""
    parts = [(np.zeros((0, 2)), np.zeros(0), np.zeros(0))]  # a town may be too small for any
    for line in kerb_lines(roads, SIDEWALK_WIDTH + SETBACK):
        if line.length < SHORTEST_BLOCK:
            continue
        width = random_lengths(line.length, *layout.frontage, rng)
        parts.append((*chords(line, np.cumsum(width) - width / 2, width / 2), width))
    middles, outward, frontage = (np.concatenate(arrays) for arrays in zip(*parts, strict=True))
    return middles, outward, frontage


def _buildings(roads: RoadNetwork, appearance: Appearance, rng: np.random.Generator) -> Iterator[Prop]:
    """Houses on their plots, and what stands in the gaps between them."""
    layout = appearance.layout
    middles, outward, frontage = _plots(roads, layout, rng)
    n = len(frontage)
    width, depth = frontage - rng.uniform(0.1, 0.9, n), rng.uniform(*layout.depth, n)
    built = rng.random(n) >= layout.gap_share
    floors = rng.integers(layout.floors[0], layout.floors[1] + 1, n)
    variant = rng.integers(N_BUILDING_TYPES, size=n)
    keep_off = roads.roadway.buffer(SIDEWALK_WIDTH + HOUSE_CLEARANCE)
    shapely.prepare(keep_off)
    center, fits = _houses_off(keep_off, middles, outward, depth, width)
    chosen = np.flatnonzero(built & fits)
    chosen = chosen[without_overlaps(box_shapes(center[chosen], outward[chosen], depth[chosen], width[chosen]))]
    for i in chosen:
        size = (float(depth[i]), float(width[i]), float(floors[i] * layout.floor_height))
        yield _prop("building", center[i], outward[i], size, int(variant[i]))
    houses = box_shapes(center[chosen], outward[chosen], depth[chosen] + 0.5, width[chosen] + 0.5)
    empty = np.setdiff1d(np.arange(n), chosen)
    occupied = (shapely.union_all(houses), keep_off)
    yield from _in_gaps(middles[empty], outward[empty], occupied, appearance, rng)


def _houses_off(
    keep_off: shapely.Geometry, middles: Points, outward: Floats, depth: Floats, width: Floats
) -> tuple[Points, NDArray[np.bool_]]:
    """Centres (N, 2) of houses on their plots, pushed back until they stay off an area, and whether they do (N,)."""
    center, fits = np.zeros((len(middles), 2)), np.zeros(len(middles), dtype=bool)
    for back in PUSHED_BACK:
        candidates = beyond(middles, outward, depth / 2 + back)
        free = ~fits & ~shapely.intersects(keep_off, box_shapes(candidates, outward, depth, width))
        center[free] = candidates[free]
        fits |= free
    return center, fits


def _in_gaps(
    places: Points, outward: Floats, occupied: Sequence[shapely.Geometry], appearance: Appearance,
    rng: np.random.Generator,
) -> Iterator[Prop]:  # fmt: skip
    """Something on each plot without a house, where it stays off what is occupied."""
    options = appearance.layout.in_gaps
    kinds = [options[k] for k in rng.integers(len(options), size=len(places))]
    sizes = tuple(_size(kind, 0, appearance.furniture) for kind in kinds)
    length, width, _ = np.array(sizes).reshape(-1, 3).T
    center = beyond(places, outward, length / 2 + 0.3)
    shapes = box_shapes(center, outward, length, width)
    free = ~np.any([shapely.intersects(area, shapes) for area in occupied], axis=0)
    for i in np.flatnonzero(free)[without_overlaps(shapes[free])]:
        yield _prop(kinds[i], center[i], outward[i], sizes[int(i)], int(rng.integers(N_VARIANTS)))


def _trees(roads: RoadNetwork, layout: StreetLayout, posts: Sequence[Prop], rng: np.random.Generator) -> Iterator[Prop]:
    places, outward = places_along(roads, TREE_LINE, layout.tree_spacing, rng)
    heights, variants = rng.uniform(*layout.tree_height, len(places)), rng.integers(3, size=len(places))
    for i in np.flatnonzero(clear_of(places, positions(posts), CLEAR_OF_POSTS)):
        size = (0.4, 0.4, float(heights[i]))
        yield _prop("tree", places[i], outward[i], size, int(variants[i]))


def _furniture(
    roads: RoadNetwork, posts: Sequence[Prop], trees: Sequence[Prop], furniture: StreetFurniture,
    rng: np.random.Generator,
) -> Iterator[Prop]:  # fmt: skip
    """Street lamps along the kerb, well away from posts; small things at the back of the sidewalk."""
    small = (*SMALL_THINGS, *("distractor" for _ in furniture.distractors))
    rows = (
        (LAMP_LINE, LAMP_SPACING, ("lamp",), LAMP_CLEAR_OF_POSTS),
        (TREE_LINE, furniture.spacing, small, FURNITURE_CLEAR_OF_POSTS),
    )
    for distance, spacing, kinds, clear in rows:
        places, outward = places_along(roads, distance, spacing, rng)
        chosen = rng.integers(len(kinds), size=len(places))
        free = clear_of(places, positions(posts), clear) & clear_of(places, positions(trees), CLEAR_OF_TREES)
        for i in np.flatnonzero(free):
            kind, variant = kinds[chosen[i]], int(rng.integers(N_VARIANTS))
            yield _prop(kind, places[i], outward[i], _size(kind, variant, furniture), variant)


def _size(kind: str, variant: int, furniture: StreetFurniture) -> tuple[float, float, float]:
    """Length, width and height of a kind of furniture, m."""
    distractor = furniture.distractor(kind, variant)
    return (distractor.length, distractor.width, distractor.height) if distractor else _SIZES[kind]


def _prop(kind: str, place: Points, outward: float, size: tuple[float, float, float], variant: int) -> Prop:
    """A prop that looks at the road, with its length, width and height in m."""
    length, width, height = size
    return Prop(kind, _facing_road(place, outward), length=length, width=width, height=height, variant=variant)


def _facing_road(place: Points, outward: float) -> Pose:
    return Pose(float(place[0]), float(place[1]), float(outward) + math.pi)
