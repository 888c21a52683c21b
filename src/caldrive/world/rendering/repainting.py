"""One thing of a town painted otherwise, to see what that changes for who looks at its pictures."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from caldrive.datatypes import Pose, Semantic
from caldrive.world.rendering.town_mesh import TownVertices
from caldrive.world.scene.appearance import RoadPaint
from caldrive.world.scene.furniture import SIGN_RADIUS
from caldrive.world.scene.ground import FAR_AWAY, JUNCTION_HALF_WIDTH, UNITS_PER_METRE
from caldrive.world.scene.textures import SIGN_LAYERS


@dataclass(frozen=True)
class Repainting:
    """What is painted otherwise."""

    surfaces: Callable[[TownVertices], TownVertices] = lambda vertices: vertices
    """Of what stands still."""
    lines: Callable[[RoadPaint], RoadPaint] = lambda paint: paint
    """Of the road markings."""


def sign_with(foot: Pose, limit: int) -> Repainting:
    """The sign whose post stands at a foot gets another number (km/h)."""

    def surfaces(vertices: TownVertices) -> TownVertices:
        away = np.hypot(*(vertices.positions[:, :2] - (foot.x, foot.y)).T)
        uv = vertices.uv.copy()
        uv[(vertices.traits[:, 3] == Semantic.SIGN) & (away <= 2 * SIGN_RADIUS), 2] = SIGN_LAYERS[limit]
        return vertices._replace(uv=uv)

    return Repainting(surfaces)


def without_center_lines() -> Repainting:
    """No line parts the lanes."""
    return Repainting(lines=lambda paint: replace(paint, center_half_width=0.0))


def without_outlines() -> Repainting:
    """Nothing shows where the road ends: its edge lines are gone, and asphalt reaches up to the houses."""
    return Repainting(_paved_over, lambda paint: replace(paint, edge_half_width=0.0))


def _paved_over(vertices: TownVertices) -> TownVertices:
    """Sidewalks and the ground behind them become asphalt as in a junction, for the road's shader."""
    beside = np.isin(vertices.traits[:, 3], (Semantic.SIDEWALK, Semantic.GROUND))
    uv, traits = vertices.uv.copy(), vertices.traits.copy()
    uv[beside] = 0, 0, FAR_AWAY
    traits[beside, 3], traits[beside, 4:6] = Semantic.ROAD, 0
    traits[beside, 6] = round(JUNCTION_HALF_WIDTH * UNITS_PER_METRE)
    return vertices._replace(uv=uv, traits=traits)
