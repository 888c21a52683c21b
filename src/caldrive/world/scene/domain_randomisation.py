"""Domain randomisation: random appearances of the same streets, for recordings that teach what a street looks like
anywhere.

No façade, paving, ground cover or tree crown of `town02` is in any of them. Their fast roads have other limits, too: a
network that knows every street by heart would tell 60 from 90 by the street.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from caldrive.datatypes import Sign
from caldrive.world.scene.appearance import (
    N_BUILDING_TYPES,
    N_VARIANTS,
    Appearance,
    BuildingType,
    Color,
    Distractor,
    GroundCover,
    Range,
    RoadPaint,
    StreetFurniture,
    StreetLayout,
    TreeType,
)
from caldrive.world.scene.meshes import RGB, Surface
from caldrive.world.scene.textures import Tex
from caldrive.world.scene.town_appearances import TOWN01, TOWN_APPEARANCES

T = TypeVar("T")

FAST = (60, 90)  # km/h; junctions and corners keep their 30
INVENTED = tuple(tex for tex in Tex if tex.name.startswith("INVENTED"))
PAVINGS = (Tex.PLAIN, Tex.ASPHALT, Tex.SLABS, Tex.GRASS, Tex.TILES, Tex.PLATES, Tex.SETTS, Tex.PLANKS, Tex.CONCRETE)
YARDS = (*PAVINGS, Tex.LEAVES)
UPPER_FLOORS = (Tex.SASH, Tex.PANE, Tex.BALCONY, Tex.PLAIN, Tex.CONCRETE, Tex.SETTS, *INVENTED, *INVENTED)
GROUND_FLOORS = (Tex.HALL, Tex.SHOP, Tex.PLANKS, Tex.PLATES, *INVENTED)
CROWNS = (Tex.LEAVES, Tex.LEAVES, Tex.GRASS)
IN_GAPS = ("hedge", "billboard", "fence", "shed", "shed")


def town_appearance(town: str, number: int) -> Appearance:
    """The town's own appearance for number 0; else a random one, that depends on the number only."""
    if number == 0:
        return TOWN_APPEARANCES[town]
    rng = np.random.default_rng([20181029, number])
    return Appearance(  # the order of the fields is the order of the random numbers
        layout=_layout(rng),
        paint=_paint(rng),
        ground=_ground(rng),
        buildings=tuple(_building(rng) for _ in range(N_BUILDING_TYPES)),
        trees=tuple(_tree(tree, rng) for tree in TOWN01.trees),
        fence=_tint(rng, 80, 230, 0.3),
        sun_azimuth=float(rng.uniform(-math.pi, math.pi)),
        lamp_arm=float(rng.choice([0.0, 0.5, 1.0, 1.5])),
        furniture=_furniture(rng),
        number=number,
    )


def town_signs(signs: Sequence[Sign], number: int) -> tuple[Sign, ...]:
    """A town's own signs for appearance 0; else each post with 60 or 90 has any of the two."""
    if number == 0:
        return tuple(signs)
    rng = np.random.default_rng([20181030, number])
    posts = {sign.stands_at: sign.limit for sign in signs}
    limits = {foot: one_of(FAST, rng) if limit in FAST else limit for foot, limit in posts.items()}
    return tuple(replace(sign, limit=limits[sign.stands_at]) for sign in signs)


def one_of(options: Sequence[T], rng: np.random.Generator) -> T:
    """Any of some options, each as likely."""
    return options[int(rng.integers(len(options)))]


def _range(rng: np.random.Generator, low: float, high: float, widest: float) -> Range:
    """A least and a most value: the least between two bounds, the most at most `widest` above it."""
    least = float(rng.uniform(low, high))
    return least, least + float(rng.uniform(0.0, widest))


def _shades(rng: np.random.Generator, low: float, high: float, spread: float) -> NDArray[np.float64]:
    """A colour (3,): a grey between two bounds, each channel off it by at most a share."""
    return np.asarray(rng.uniform(low, high) * (1 + spread * rng.uniform(-1, 1, 3)))


def _tint(rng: np.random.Generator, low: float, high: float, spread: float) -> RGB:
    """A colour in bytes."""
    r, g, b = np.clip(_shades(rng, low, high, spread), 0, 255).astype(int).tolist()
    return r, g, b


def _color(rng: np.random.Generator, low: float, high: float, spread: float) -> Color:
    """A colour in shares of full brightness."""
    r, g, b = np.clip(_shades(rng, low, high, spread), 0, 1).tolist()
    return r, g, b


def _layout(rng: np.random.Generator) -> StreetLayout:
    least_floors = int(rng.integers(2, 5))
    return StreetLayout(
        frontage=_range(rng, 7, 20, 12),
        depth=_range(rng, 7, 13, 5),
        floors=(least_floors, least_floors + int(rng.integers(0, 5))),
        floor_height=float(rng.uniform(2.6, 4.2)),
        gap_share=float(rng.uniform(0.05, 0.6)),
        tree_spacing=_range(rng, 7, 30, 20),
        tree_height=_range(rng, 3.5, 8.0, 3.5),
        in_gaps=IN_GAPS,
    )


def _paint(rng: np.random.Generator) -> RoadPaint:
    yellow = float(rng.uniform(0, 1))
    bright = float(rng.uniform(0.75, 1.0))
    return RoadPaint(
        center=(bright, bright * (1 - 0.35 * yellow), bright * (1 - 0.9 * yellow)),
        center_half_width=float(rng.uniform(0.06, 0.13)),
        edge_half_width=float(rng.uniform(0.03, 0.11)),
        edge_inset=float(rng.uniform(0.1, 0.4)),
        dash_share=float(rng.uniform(0.3, 0.65)),
        edge=_color(rng, 0.7, 1.0, 0.06),
        asphalt=_color(rng, 0.36, 0.78, 0.07),
    )


def _ground(rng: np.random.Generator) -> GroundCover:
    pavement = Surface(layer=one_of(PAVINGS, rng), color=_tint(rng, 60, 250, 0.45), tile=float(rng.uniform(1.0, 4.0)))
    yard = Surface(layer=one_of(YARDS, rng), color=_tint(rng, 80, 250, 0.35), tile=float(rng.uniform(3.0, 12.0)))
    return GroundCover(dash=float(rng.uniform(3.0, 9.0)), kerb=_tint(rng, 70, 240, 0.2), pavement=pavement, yard=yard)


def _building(rng: np.random.Generator) -> BuildingType:
    rise = 0.0 if rng.random() < 0.4 else float(rng.uniform(1.0, 4.0))
    roof = Tex.TILES if rise and rng.random() < 0.7 else Tex.PLAIN
    return BuildingType(
        upper=one_of(UPPER_FLOORS, rng),
        ground=one_of(GROUND_FLOORS, rng),
        tint=_tint(rng, 70, 250, 0.45),
        base=_tint(rng, 90, 250, 0.3),
        roof=roof,
        roof_tint=_tint(rng, 50, 220, 0.5),
        rise=rise,
    )


def _tree(tree: TreeType, rng: np.random.Generator) -> TreeType:
    """A tree of the training town, thicker or thinner, lower or higher up, of another colour."""
    wide, foot = float(rng.uniform(0.5, 1.3)), float(rng.uniform(-0.9, 0.9))
    return TreeType(
        profile=tuple((r * wide, z + foot * (6.0 - z) / 4.0) for r, z in tree.profile),
        color=_tint(rng, 60, 190, 0.5),
        layer=one_of(CROWNS, rng),
        bark=_tint(rng, 50, 200, 0.2),
    )


def _distractor(rng: np.random.Generator, largest: tuple[float, float, float]) -> Distractor:
    """A box of any colour: length, width and height (m) are between a quarter and all of the largest ones."""
    length, width, height = (np.array(largest) * rng.uniform(0.25, 1.0, 3)).tolist()
    surface = Surface(color=_tint(rng, 30, 240, 0.9), layer=one_of((*PAVINGS, *INVENTED), rng), tile=2.0)
    return Distractor(length, width, height, surface)


def _furniture(rng: np.random.Generator) -> StreetFurniture:
    hues = tuple(_tint(rng, 40, 220, 0.7) for _ in range(N_VARIANTS))
    bench, bin, hydrant = (_tint(rng, 30, 230, 0.7) for _ in range(3))
    distractors = tuple(_distractor(rng, (1.2, 2.0, 2.4)) for _ in range(N_VARIANTS))
    return StreetFurniture(
        hues=hues,
        bench=bench,
        bin=bin,
        hydrant=hydrant,
        distractors=distractors,
        spacing=_range(rng, 6, 20, 20),
        shed=_distractor(rng, (4.0, 7.0, 4.0)),
    )
