"""Decors made up at random: the same streets as if they lay in another town, for recordings that teach what a street
looks like anywhere.

No façade, paving, ground cover or crown of `town02` is in any of them. Their fast roads have other limits, too: a
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
from caldrive.world.scene.decor import (
    N_VARIANTS,
    TOWNS,
    Color,
    Crown,
    Decor,
    Design,
    Furniture,
    Ground,
    Oddment,
    Paint,
    Style,
)
from caldrive.world.scene.meshes import RGB
from caldrive.world.scene.textures import Tex

T = TypeVar("T")

N_DESIGNS = 6
FAST = (60, 90)  # km/h; junctions and corners keep their 30
INVENTED = tuple(tex for tex in Tex if tex.name.startswith("INVENTED"))

PAVINGS = (Tex.PLAIN, Tex.ASPHALT, Tex.SLABS, Tex.GRASS, Tex.TILES, Tex.PLATES, Tex.SETTS, Tex.PLANKS, Tex.CONCRETE)

YARDS = (*PAVINGS, Tex.LEAVES)

UPPER = (Tex.SASH, Tex.PANE, Tex.BALCONY, Tex.PLAIN, Tex.CONCRETE, Tex.SETTS, *INVENTED, *INVENTED)

IN_GAPS = ("hedge", "billboard", "fence", "shed", "shed")

GROUND_FLOOR = (Tex.HALL, Tex.SHOP, Tex.PLANKS, Tex.PLATES, *INVENTED)


def randomised_decor(town: str, appearance: int) -> Decor:
    """A town's own decor for appearance 0; else one that depends on the number only."""
    if not appearance:
        return TOWNS[town]
    rng = np.random.default_rng([20181029, appearance])
    return Decor(
        _style(rng), _paint(rng), _ground(rng), tuple(_design(rng) for _ in range(N_DESIGNS)),
        tuple(_crown(crown, rng) for crown in TOWNS["town01"].crowns), fence=_tint(rng, 80, 230, 0.3),
        sun=float(rng.uniform(-math.pi, math.pi)), arm=float(rng.choice([0.0, 0.5, 1.0, 1.5])),
        furniture=_furniture(rng),
    )  # fmt: skip


def shown_signs(signs: Sequence[Sign], appearance: int) -> tuple[Sign, ...]:
    """A town's own signs for appearance 0; else each 60 or 90 is any of the two."""
    if not appearance:
        return tuple(signs)
    rng = np.random.default_rng([20181030, appearance])
    return tuple(replace(sign, limit=one_of(FAST, rng)) if sign.limit in FAST else sign for sign in signs)


def _range(rng: np.random.Generator, low: float, high: float, widest: float) -> tuple[float, float]:
    """A least and a most value between two bounds, at most `widest` apart."""
    least = float(rng.uniform(low, high))
    return least, least + float(rng.uniform(0.0, widest))


def one_of(things: Sequence[T], rng: np.random.Generator) -> T:
    """Any of some things, each as likely."""
    return things[int(rng.integers(len(things)))]


def _shades(rng: np.random.Generator, low: float, high: float, spread: float) -> NDArray[np.float64]:
    """A colour: a grey between two bounds, each channel off it by at most a share."""
    return np.asarray(rng.uniform(low, high) * (1 + spread * rng.uniform(-1, 1, 3)))


def _tint(rng: np.random.Generator, low: float, high: float, spread: float) -> RGB:
    """A colour in bytes."""
    r, g, b = np.clip(_shades(rng, low, high, spread), 0, 255).astype(int).tolist()
    return r, g, b


def _color(rng: np.random.Generator, low: float, high: float, spread: float) -> Color:
    """A colour in shares of full brightness."""
    r, g, b = np.clip(_shades(rng, low, high, spread), 0, 1).tolist()
    return r, g, b


def _style(rng: np.random.Generator) -> Style:
    floors = int(rng.integers(2, 5))
    return replace(
        TOWNS["town01"].style, frontage=_range(rng, 7, 20, 12), depth=_range(rng, 7, 13, 5),
        floors=(floors, floors + int(rng.integers(0, 5))), floor=float(rng.uniform(2.6, 4.2)),
        gap=float(rng.uniform(0.05, 0.6)), tree_gap=_range(rng, 7, 30, 20), tree_height=_range(rng, 3.5, 8.0, 3.5),
        in_gaps=IN_GAPS,
    )  # fmt: skip


def _paint(rng: np.random.Generator) -> Paint:
    yellow = float(rng.uniform(0, 1))
    bright = float(rng.uniform(0.75, 1.0))
    center = (bright, bright * (1 - 0.35 * yellow), bright * (1 - 0.9 * yellow))
    stripes = tuple(float(rng.uniform(*bounds)) for bounds in ((0.06, 0.13), (0.03, 0.11), (0.1, 0.4), (0.3, 0.65)))
    return Paint(center, _color(rng, 0.7, 1.0, 0.06), _color(rng, 0.36, 0.78, 0.07), stripes)  # type: ignore[arg-type]


def _ground(rng: np.random.Generator) -> Ground:
    pavement = one_of(PAVINGS, rng), _tint(rng, 60, 250, 0.45), float(rng.uniform(1.0, 4.0))
    yard = one_of(YARDS, rng), _tint(rng, 80, 250, 0.35), float(rng.uniform(3.0, 12.0))
    return Ground(float(rng.uniform(3.0, 9.0)), _tint(rng, 70, 240, 0.2), pavement, yard)


def _design(rng: np.random.Generator) -> Design:
    rise = 0.0 if rng.random() < 0.4 else float(rng.uniform(1.0, 4.0))
    roof = Tex.TILES if rise and rng.random() < 0.7 else Tex.PLAIN
    return Design(
        one_of(UPPER, rng), one_of(GROUND_FLOOR, rng), _tint(rng, 70, 250, 0.45), _tint(rng, 90, 250, 0.3),
        roof, _tint(rng, 50, 220, 0.5), rise,
    )  # fmt: skip


def _crown(crown: Crown, rng: np.random.Generator) -> Crown:
    """A tree of the training town, thicker or thinner, lower or higher up, of another colour."""
    wide, foot = float(rng.uniform(0.5, 1.3)), float(rng.uniform(-0.9, 0.9))
    profile = tuple((r * wide, z + foot * (6.0 - z) / 4.0) for r, z in crown.profile)
    color = _tint(rng, 60, 190, 0.5)
    return Crown(profile, color, one_of((Tex.LEAVES, Tex.LEAVES, Tex.GRASS), rng), _tint(rng, 50, 200, 0.2))


def _oddment(rng: np.random.Generator, length: float, width: float, height: float) -> Oddment:
    """A box with at least a quarter of the sizes in m, of any colour."""
    length, width, height = (np.array((length, width, height)) * rng.uniform(0.25, 1.0, 3)).tolist()
    return Oddment(length, width, height, _tint(rng, 30, 240, 0.9), one_of((*PAVINGS, *INVENTED), rng))


def _furniture(rng: np.random.Generator) -> Furniture:
    hues = tuple(_tint(rng, 40, 220, 0.7) for _ in range(N_VARIANTS))
    bench, bin, hydrant = (_tint(rng, 30, 230, 0.7) for _ in range(3))
    oddments = tuple(_oddment(rng, 1.2, 2.0, 2.4) for _ in range(N_VARIANTS))
    return Furniture(hues, bench, bin, hydrant, _range(rng, 6, 20, 20), oddments, _oddment(rng, 4.0, 7.0, 4.0))
