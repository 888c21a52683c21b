"""The classes of the semantic image. In meshes of what stands still, a vertex's slot is its class."""

from __future__ import annotations

from dataclasses import replace
from enum import IntEnum

from caldrive.world.meshes import Detail, Mesh


class Semantic(IntEnum):
    """Classes of pixels, as numbers in a recording."""

    SKY = 0
    ROAD = 1
    LINE = 2
    SIDEWALK = 3
    GROUND = 4
    BUILDING = 5
    PLANT = 6
    FURNITURE = 7
    LIGHT = 8
    SIGN = 9
    VEHICLE = 10
    PERSON = 11


# Of props; all others are furniture.
PROP_CLASSES = {"tree": Semantic.PLANT, "hedge": Semantic.PLANT, "light_post": Semantic.LIGHT}


def classed(mesh: Mesh, semantic: Semantic) -> Mesh:
    """The mesh with a class on all vertices that have none yet."""
    made = mesh.vertices.copy()
    made["slot"][made["slot"] == 0] = semantic
    return replace(mesh, vertices=made)


def classed_detail(detail: Detail, semantic: Semantic) -> Detail:
    """The same for all parts of a thing."""
    return Detail(*(classed(mesh, semantic) for mesh in (detail.always, detail.near, detail.far)))
