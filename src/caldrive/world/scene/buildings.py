"""Buildings as meshes, all of a town at once: façades by type, tiled hip roofs or flat ones."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from caldrive.datatypes import Points
from caldrive.geometry import box_corners
from caldrive.world.scene.appearance import Appearance, BuildingType
from caldrive.world.scene.meshes import BUILDING_SHADOWS, LodMesh, Mesh, merge, quads
from caldrive.world.scene.scenery import Prop
from caldrive.world.scene.textures import Tex

BAY = 5.6  # m of façade in one layer: two bays upstairs, four half-width ones on the ground floor
OVERHANG = 0.35  # m that the eaves stand out, where a house is 10 m wide
FOOT = -0.06  # m, where walls begin: a little under the ground
Floats = NDArray[np.float64]


@dataclass(frozen=True)
class _Facade:
    """Texture layers (N,) and tints (N, 3) of N walls."""

    layer: NDArray[np.int_]
    tint: NDArray[np.int_]


def building_meshes(props: Sequence[Prop], appearance: Appearance) -> LodMesh:
    """All buildings among the props; from afar their ground floors look like the others."""
    houses = [prop for prop in props if prop.kind == "building"]
    if not houses:
        return LodMesh()
    types = [appearance.buildings[house.variant] for house in houses]
    # from front right counter-clockwise, so that the walls look outwards
    footprints: list[Points] = [np.roll(box_corners(h.pose, h.length, h.width), 1, axis=0) for h in houses]
    corners, height = np.array(footprints), np.array([house.height for house in houses])
    floor = appearance.layout.floor_height
    foot, first = np.full(len(houses), FOOT), np.full(len(houses), floor)
    upper = _Facade(np.array([int(kind.upper) for kind in types]), np.array([kind.tint for kind in types]))
    ground = _Facade(np.array([int(kind.ground) for kind in types]), np.array([kind.base for kind in types]))
    near = merge((
        _walls(corners, foot, first, ground, np.ones(len(houses))),
        _walls(corners, first, height, upper, (height - floor) / floor / 2),
        _eaves(corners, height, types),
    ))  # fmt: skip
    far = _walls(corners, foot, height, upper, height / floor / 2)
    return LodMesh(_roofs(corners, height, types), near, far)


def _walls(corners: Floats, low: Floats, high: Floats, facade: _Facade, tiles_high: Floats) -> Mesh:
    """Four walls for each of N footprints (N, 4, 2), whole bays wide, from low to high (N,) in m. tiles_high: how many
    times the texture is repeated upwards."""
    following = np.roll(corners, -1, axis=1)
    bays = np.maximum(1, np.rint(np.linalg.norm(following - corners, axis=2) / BAY * 2)) / 2
    z0, z1 = (np.broadcast_to(z[:, None, None], (*corners.shape[:2], 1)) for z in (low, high))
    faces = np.stack(
        [np.concatenate(pair, 2) for pair in ((corners, z0), (following, z0), (following, z1), (corners, z1))], 2
    )
    uv = np.zeros((*corners.shape[:2], 4, 3))
    uv[..., 1:3, 0] = bays[..., None]
    uv[..., 2:, 1] = tiles_high[:, None, None]
    uv[..., 2] = facade.layer[:, None, None]
    tint = np.repeat(facade.tint, 4, axis=0)
    mesh = quads(faces.reshape(-1, 4, 3), tint, uv.reshape(-1, 4, 3), spare=BUILDING_SHADOWS)
    return Mesh(mesh.vertices, mesh.triangles, owners=np.repeat(corners.mean(axis=1), 8, axis=0))


def _with_overhang(corners: Floats) -> Floats:
    """Footprints (N, 4, 2) of the roofs over footprints of houses."""
    middle = corners.mean(axis=1, keepdims=True)
    return np.asarray(middle + (corners - middle) * (1 + 2 * OVERHANG / 10))


def _roofs(corners: Floats, height: Floats, types: Sequence[BuildingType]) -> Mesh:
    """Hip roofs with the ridge along the street; a rise of nothing makes a flat roof."""
    rise = np.array([kind.rise for kind in types])
    out = _with_overhang(corners)
    ridge_left, ridge_right = (0.5 * (out[:, a] + out[:, b]) for a, b in ((0, 1), (2, 3)))  # over the two side walls
    ridge = ridge_right - ridge_left
    inset = np.minimum(0.35, 3.0 / np.maximum(np.linalg.norm(ridge, axis=1), 1))[:, None] * ridge
    left, right = (np.column_stack((p, height + rise)) for p in (ridge_left + inset, ridge_right - inset))
    eaves = np.concatenate((out, np.broadcast_to((height - 0.02)[:, None, None], (*out.shape[:2], 1))), axis=2)
    a, b, c, d = (eaves[:, k] for k in range(4))
    slopes = (b, c, right, left), (d, a, left, right), (a, b, left, left), (c, d, right, right)
    faces = np.stack([np.stack(slope, axis=1) for slope in slopes], axis=1)
    uv = np.zeros((len(corners), 4, 4, 3))
    uv[..., 1:3, 0], uv[..., 2:, 1] = 3.0, 1.5
    uv[..., 2] = np.array([kind.roof for kind in types])[:, None, None]
    tint = np.repeat(np.array([kind.roof_tint for kind in types]), 4, axis=0)
    return quads(faces.reshape(-1, 4, 3), tint, uv.reshape(-1, 4, 3), spare=BUILDING_SHADOWS)


def _eaves(corners: Floats, height: Floats, types: Sequence[BuildingType]) -> Mesh:
    """The roof's edge: a band around the top of each building, in the roof's colour where it is tiled."""
    tint = np.array([kind.roof_tint if kind.rise > 0 else kind.base for kind in types]) * 0.8
    plain = _Facade(np.full(len(corners), int(Tex.PLAIN)), tint.astype(int))
    return _walls(_with_overhang(corners), height - 0.3, height + 0.02, plain, np.ones(len(corners)))
