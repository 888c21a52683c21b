"""The own looks of generated towns: random, but of what streets are made of. Wilder ones are domain randomisation's.

As there, no façade, paving, ground cover or tree crown of `town02` is in any of them.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from caldrive.scenarios import GeneratedTown, generated_town
from caldrive.world.scene.appearance import (
    N_BUILDING_TYPES,
    Appearance,
    BuildingType,
    GroundCover,
    RoadPaint,
    StreetFurniture,
    StreetLayout,
    TreeType,
)
from caldrive.world.scene.domain_randomisation import INVENTED, one_of
from caldrive.world.scene.meshes import RGB, Surface
from caldrive.world.scene.textures import Tex
from caldrive.world.scene.town_appearances import TOWN01, TOWN_APPEARANCES

SALT = 20181032  # parts these random numbers from those of other things with the same seed
WALLS: tuple[RGB, ...] = (
    (240, 226, 190), (228, 196, 140), (214, 160, 120), (188, 108, 88), (236, 232, 224), (196, 196, 192),
    (196, 210, 190), (190, 206, 222), (232, 190, 170), (150, 130, 116),
)  # fmt: skip
UPPER_FLOORS = (Tex.SASH, Tex.PANE, Tex.BALCONY)
BASES: tuple[RGB, ...] = ((226, 220, 208), (200, 196, 190), (178, 164, 150), (232, 216, 196))
TILES: tuple[RGB, ...] = ((192, 94, 68), (150, 78, 62), (120, 92, 84), (100, 96, 98))
PAVINGS = ((Tex.SLABS, 2.4), (Tex.SETTS, 1.6), (Tex.CONCRETE, 3.0), (Tex.PLATES, 2.4))  # and m of one repeat
PAVING_TINTS: tuple[RGB, ...] = ((214, 212, 208), (190, 188, 184), (206, 190, 172), (176, 178, 182))
YARDS: tuple[tuple[Tex, RGB], ...] = (
    (Tex.GRASS, (235, 240, 225)), (Tex.GRASS, (214, 226, 190)), (Tex.GRASS, (236, 224, 186)),
    (Tex.CONCRETE, (190, 186, 180)), (Tex.SETTS, (186, 176, 164)),
)  # fmt: skip
CROWNS: tuple[RGB, ...] = ((98, 142, 62), (126, 158, 70), (82, 126, 64), (146, 150, 72), (184, 142, 66), (110, 134, 86))
BARKS: tuple[RGB, ...] = ((104, 84, 66), (120, 110, 98), (84, 70, 58))
CENTERS = ((0.93, 0.70, 0.20), (0.92, 0.92, 0.90))  # yellow and white


def own_appearance(town: str) -> Appearance:
    """How a town of ours or a generated one looks where nothing is randomised."""
    generated = generated_town(town)
    return generated_appearance(generated) if generated else TOWN_APPEARANCES[town]


def generated_appearance(town: GeneratedTown) -> Appearance:
    """The own look of a generated town, which depends on its seed only."""
    rng = np.random.default_rng([SALT, town.seed])
    return Appearance(  # the order of the fields is the order of the random numbers
        layout=_layout(rng),
        paint=_paint(rng),
        ground=_ground(rng),
        buildings=tuple(_building(rng) for _ in range(N_BUILDING_TYPES)),
        trees=tuple(_tree(tree, rng) for tree in TOWN01.trees),
        fence=_near(one_of(BASES, rng), rng),
        sun_azimuth=float(rng.uniform(-math.pi, math.pi)),
        lamp_arm=float(rng.choice([0.0, 0.5, 1.0])),
        furniture=replace(StreetFurniture(), spacing=(float(rng.uniform(10, 18)), float(rng.uniform(24, 40)))),
    )


def _near(color: RGB, rng: np.random.Generator, spread: float = 0.08) -> RGB:
    """A colour of which each channel is off another by at most a share."""
    r, g, b = np.clip(np.array(color) * rng.uniform(1 - spread, 1 + spread, 3), 0, 255).astype(int).tolist()
    return r, g, b


def _layout(rng: np.random.Generator) -> StreetLayout:
    frontage, spacing, height = rng.uniform(8, 13), rng.uniform(8, 18), rng.uniform(4.5, 6.5)
    floors = int(rng.integers(2, 4))
    return StreetLayout(
        frontage=(frontage, frontage + rng.uniform(4, 10)),
        depth=(9.0, 9.0 + rng.uniform(2, 5)),
        floors=(floors, floors + int(rng.integers(1, 4))),
        floor_height=rng.uniform(2.9, 3.5),
        gap_share=rng.uniform(0.08, 0.35),
        tree_spacing=(spacing, spacing + rng.uniform(6, 16)),
        tree_height=(height, height + rng.uniform(1.5, 3.0)),
        in_gaps=TOWN01.layout.in_gaps,
    )


def _paint(rng: np.random.Generator) -> RoadPaint:
    grey = rng.uniform(0.42, 0.62)
    white = rng.uniform(0.84, 0.95)
    return RoadPaint(
        center=one_of(CENTERS, rng),
        edge=(white, white, white - 0.02),
        asphalt=(grey, grey * rng.uniform(0.97, 1.0), grey * rng.uniform(0.94, 1.02)),
        center_half_width=rng.uniform(0.07, 0.11),
        edge_half_width=rng.uniform(0.05, 0.09),
        edge_inset=rng.uniform(0.15, 0.35),
        dash_share=rng.uniform(0.4, 0.6),
    )


def _ground(rng: np.random.Generator) -> GroundCover:
    paving, tile = one_of(PAVINGS, rng)
    cover, tint = one_of(YARDS, rng)
    return GroundCover(
        dash=rng.uniform(4.5, 8.0),
        kerb=_near(one_of(PAVING_TINTS, rng), rng, 0.04),
        pavement=Surface(_near(one_of(PAVING_TINTS, rng), rng, 0.04), paving, tile=tile),
        yard=Surface(_near(tint, rng, 0.05), cover, tile=rng.uniform(5.0, 9.0)),
    )


def _building(rng: np.random.Generator) -> BuildingType:
    is_tiled = rng.random() < 0.6
    return BuildingType(
        upper=one_of((*UPPER_FLOORS, *UPPER_FLOORS, *INVENTED), rng),
        ground=one_of((Tex.HALL, Tex.SHOP), rng),
        tint=_near(one_of(WALLS, rng), rng),
        base=_near(one_of(BASES, rng), rng),
        roof=Tex.TILES if is_tiled else Tex.PLAIN,
        roof_tint=_near(one_of(TILES, rng) if is_tiled else one_of(PAVING_TINTS, rng), rng),
        rise=rng.uniform(1.8, 3.2) if is_tiled else 0.0,
    )


def _tree(tree: TreeType, rng: np.random.Generator) -> TreeType:
    """A tree of the training town, thicker or thinner."""
    wide = rng.uniform(0.75, 1.15)
    return TreeType(
        profile=tuple((radius * wide, height) for radius, height in tree.profile),
        color=_near(one_of(CROWNS, rng), rng),
        layer=Tex.LEAVES,
        bark=one_of(BARKS, rng),
    )
