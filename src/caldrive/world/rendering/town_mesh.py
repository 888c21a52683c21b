"""A town's mesh: of what stands still each picture draws the triangles in view that face the eye."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from caldrive.compiled import Floats, Integers, compiled, f32, i32
from caldrive.datatypes import Semantic
from caldrive.world.rendering.light import Light
from caldrive.world.rendering.pinhole import View
from caldrive.world.rendering.tiles import DetailLevel, Faces, TileGrid
from caldrive.world.roads.network import RoadNetwork
from caldrive.world.scene.appearance import Appearance
from caldrive.world.scene.buildings import building_meshes
from caldrive.world.scene.furniture import furniture_meshes
from caldrive.world.scene.ground import (
    KERB_HEIGHT,
    UNITS_PER_METRE,
    far_kerb_mesh,
    kerb_mesh,
    road_mesh,
    yard_mesh,
)  # fmt: skip
from caldrive.world.scene.meshes import BUILDING_SHADOWS, Vertices, lod_with_class, with_class
from caldrive.world.scene.scenery import Prop

ROAD, SIGN, NO_TREES = int(Semantic.ROAD), int(Semantic.SIGN), BUILDING_SHADOWS
ZERO, HALF, ONE, PER_BYTE = f32(0.0), f32(0.5), f32(1.0), f32(1 / 255)
AHEAD_OF_WALLS = f32(0.8)  # m before a wall where its shadow is looked up
METRES_PER_UNIT = f32(1 / UNITS_PER_METRE)


class TownVertices(NamedTuple):
    """The vertices of a town."""

    positions: Floats
    """(V, 3) in m."""
    uv: Floats
    """(V, 3)."""
    traits: NDArray[np.uint8]
    """(V, 8): normal (3), semantic class, colour (3), spare byte, as in `meshes.VERTEX`."""


def town_grid(roads: RoadNetwork, scenery: Sequence[Prop], appearance: Appearance) -> TileGrid:
    """Everything in a town that stands still, in tiles."""
    houses = lod_with_class(building_meshes(scenery, appearance), Semantic.BUILDING)
    furniture = furniture_meshes(scenery, appearance, foot=KERB_HEIGHT)
    ground = appearance.ground
    return TileGrid([
        (with_class(road_mesh(roads, ground), Semantic.ROAD), DetailLevel.ALWAYS),
        (houses.always, DetailLevel.ALWAYS), (houses.near, DetailLevel.NEAR), (houses.far, DetailLevel.FAR),
        (furniture.always, DetailLevel.ALWAYS), (furniture.near, DetailLevel.NEAR), (furniture.far, DetailLevel.FAR),
        (with_class(kerb_mesh(roads, ground), Semantic.SIDEWALK), DetailLevel.NEAR),
        (with_class(far_kerb_mesh(roads, ground), Semantic.SIDEWALK), DetailLevel.ALWAYS),
        (with_class(yard_mesh(roads, ground), Semantic.GROUND), DetailLevel.ALWAYS),
    ])  # fmt: skip


def town_vertices(vertices: Vertices) -> TownVertices:
    """Vertices (V,) as compiled code reads them."""
    names = ("normal", "slot", "color", "spare")
    traits = np.concatenate([vertices[name].reshape(len(vertices), -1) for name in names], axis=1)
    return TownVertices(
        np.ascontiguousarray(vertices["position"]), np.ascontiguousarray(vertices["uv"]), np.ascontiguousarray(traits)
    )


@compiled
def project_town(faces: Faces, positions: Floats, view: View, corners: Floats, sources: Integers, n: int) -> int:
    """Writes the clip coordinates of those faces that look at the eye and lie in view, from place n on; returns where
    they end. sources: (triangles, 2), of which the second is the face's number."""
    slope, matrix, eye = np.sqrt(ONE + view.tangent * view.tangent), view.matrix, view.position
    for face in range(len(faces.triangles)):
        plane = faces.planes[face]
        if plane[0] * eye[0] + plane[1] * eye[1] + plane[2] * eye[2] + plane[3] <= ZERO:
            continue
        dx, dy, reach = faces.middles[face, 0] - eye[0], faces.middles[face, 1] - eye[1], faces.reach[face]
        ahead = view.sides[0, 0] * dx + view.sides[0, 1] * dy
        beside = view.sides[1, 0] * dx + view.sides[1, 1] * dy
        if ahead <= -reach or abs(beside) - ahead * view.tangent >= reach * slope:
            continue
        for k in range(3):
            position = positions[faces.triangles[face, k]]
            for axis in range(3):
                corners[n, k, axis] = (
                    matrix[axis, 0] * position[0] + matrix[axis, 1] * position[1] + matrix[axis, 2] * position[2]
                    + matrix[axis, 3]
                )  # fmt: skip
        sources[n, 1] = i32(face)
        n += 1
    return n


@compiled
def road_values(vertices: TownVertices, triangle: NDArray[np.uint32], values: Floats, flat: Floats) -> None:
    """Writes what `surfaces` needs of a triangle of asphalt: values (3, VALUES) and flat (FLATS,)."""
    color = vertices.traits[triangle[2], 4:7]
    flat[0], flat[1], flat[2] = f32(color[0]), f32(color[1]), f32(color[2]) * METRES_PER_UNIT
    for k in range(3):
        for axis in range(3):
            values[k, axis] = vertices.uv[triangle[k], axis]


@compiled
def standing_values(
    vertices: TownVertices, triangle: NDArray[np.uint32], light: Light, values: Floats, flat: Floats
) -> bool:
    """Likewise of a triangle of anything else that stands still; returns whether it is as bright everywhere."""
    first = vertices.traits[triangle[0]]
    before = AHEAD_OF_WALLS if first[7] == NO_TREES else ZERO
    flat[0] = vertices.uv[triangle[0], 2]
    flat[1], flat[2] = before * (f32(first[0]) - f32(128)) / f32(127), before * (f32(first[1]) - f32(128)) / f32(127)
    flat[3] = ONE if first[7] == NO_TREES else ZERO
    for k in range(3):
        vertex = triangle[k]
        traits = vertices.traits[vertex]
        values[k, 0], values[k, 1] = vertices.uv[vertex, 0], vertices.uv[vertex, 1]
        nx, ny, nz = (
            (f32(traits[0]) - f32(128)) / f32(127), (f32(traits[1]) - f32(128)) / f32(127),
            (f32(traits[2]) - f32(128)) / f32(127),
        )  # fmt: skip
        facing = nx * light.sun_direction[0] + ny * light.sun_direction[1] + nz * light.sun_direction[2]
        is_ground = nz > f32(0.9) and vertices.positions[vertex, 2] < f32(0.3)
        dark = ONE - (f32(0.30) if is_ground else f32(0.08)) * light.wetness
        up = HALF + HALF * nz
        for c in range(3):
            albedo = f32(traits[4 + c]) * PER_BYTE * dark
            lit = albedo * (light.ground_ambient[c] + up * (light.sky_ambient[c] - light.ground_ambient[c]))
            sunlit = albedo * light.sun[c] * max(facing, ZERO)
            if traits[3] == SIGN:  # signs throw the headlamps' light back
                lit, sunlit = max(lit, f32(0.80) * albedo), f32(0.4) * sunlit
            values[k, 2 + c], values[k, 5 + c] = lit, sunlit
    is_even = True
    for c in range(6):
        flat[4 + c] = values[0, 2 + c]
        if values[1, 2 + c] != flat[4 + c] or values[2, 2 + c] != flat[4 + c]:
            is_even = False
    return is_even
