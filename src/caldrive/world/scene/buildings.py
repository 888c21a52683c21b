"""Buildings as meshes, all of a town at once: façades by style and variant, tiled hip roofs or flat ones."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from caldrive.datatypes import Points
from caldrive.geometry import box_corners
from caldrive.world.scene.decor import Decor, Design
from caldrive.world.scene.meshes import Detail, Mesh, merge, quads
from caldrive.world.scene.scenery import Prop
from caldrive.world.scene.textures import Tex

BAY = 5.6  # m of façade in one layer: two bays upstairs, four half-width ones on the ground floor
EAVES = 0.35
FULL = 255  # vertices of walls look up shadows of buildings only, a little in front of themselves


def _walls(
    corners: NDArray[np.float64], low: NDArray[np.float64], high: NDArray[np.float64], layer: NDArray[np.int_],
    tint: NDArray[np.int_], tiles_high: NDArray[np.float64],
) -> Mesh:  # fmt: skip
    """Four walls for each of N footprints (N, 4, 2), whole bays wide."""
    following = np.roll(corners, -1, axis=1)
    bays = np.maximum(1, np.rint(np.linalg.norm(following - corners, axis=2) / BAY * 2)) / 2
    z0, z1 = (np.broadcast_to(z[:, None, None], (*corners.shape[:2], 1)) for z in (low, high))
    faces = np.stack(
        [np.concatenate(p, 2) for p in ((corners, z0), (following, z0), (following, z1), (corners, z1))], 2
    )
    uv = np.zeros((*corners.shape[:2], 4, 3))
    uv[..., 1:3, 0] = bays[..., None]
    uv[..., 2:, 1] = tiles_high[:, None, None]
    uv[..., 2] = layer[:, None, None]
    made = quads(faces.reshape(-1, 4, 3), np.repeat(tint, 4, axis=0), uv.reshape(-1, 4, 3), spare=FULL)
    return Mesh(made.vertices, made.triangles, np.repeat(corners.mean(axis=1), 8, axis=0))


def _roofs(corners: NDArray[np.float64], height: NDArray[np.float64], designs: Sequence[Design]) -> Mesh:
    """Hip roofs with the ridge along the street; a rise of nothing makes a flat roof."""
    rise = np.array([d.rise for d in designs])
    middle = corners.mean(axis=1, keepdims=True)
    out = middle + (corners - middle) * (1 + 2 * EAVES / 10)
    ridge_left, ridge_right = (0.5 * (out[:, a] + out[:, b]) for a, b in ((0, 1), (2, 3)))  # over the two side walls
    ridge = ridge_right - ridge_left
    inset = np.minimum(0.35, 3.0 / np.maximum(np.linalg.norm(ridge, axis=1), 1))[:, None] * ridge
    tops = [np.column_stack((p, height + rise)) for p in (ridge_left + inset, ridge_right - inset)]
    eaves = np.concatenate((out, np.broadcast_to((height - 0.02)[:, None, None], (*out.shape[:2], 1))), axis=2)
    a, b, c, d = (eaves[:, k] for k in range(4))
    left, right = tops
    slopes = (b, c, right, left), (d, a, left, right), (a, b, left, left), (c, d, right, right)
    faces = np.stack([np.stack(f, axis=1) for f in slopes], axis=1)
    uv = np.zeros((len(corners), 4, 4, 3))
    uv[..., 1:3, 0], uv[..., 2:, 1] = 3.0, 1.5
    uv[..., 2] = np.array([d.roof for d in designs])[:, None, None]
    tint = np.repeat(np.array([d.roof_tint for d in designs]), 4, axis=0)
    return quads(faces.reshape(-1, 4, 3), tint, uv.reshape(-1, 4, 3), spare=FULL)


def _eaves(corners: NDArray[np.float64], height: NDArray[np.float64], designs: Sequence[Design]) -> Mesh:
    """The roof's edge: a band around the top of each building, in the roof's colour where it is tiled."""
    middle = corners.mean(axis=1, keepdims=True)
    out = middle + (corners - middle) * (1 + 2 * EAVES / 10)
    tint = np.array([d.roof_tint if d.rise > 0 else d.base for d in designs]) * 0.8
    plain = np.full(len(corners), int(Tex.PLAIN))
    return _walls(out, height - 0.3, height + 0.02, plain, tint.astype(int), np.ones(len(corners)))


def building_meshes(props: Sequence[Prop], decor: Decor) -> Detail:
    """All buildings among the props; from afar their ground floors look like the others."""
    houses = [p for p in props if p.kind == "building"]
    if not houses:
        return Detail()
    designs = [decor.designs[p.variant] for p in houses]
    # from front right counter-clockwise, so that the walls look outwards
    footprints: list[Points] = [np.roll(box_corners(p.pose, p.length, p.width), 1, axis=0) for p in houses]
    corners, height = np.array(footprints), np.array([p.height for p in houses])
    floor = decor.style.floor
    low, first = np.full(len(houses), -0.06), np.full(len(houses), floor)
    upper = _looks(designs, "upper", "tint")
    ground_floor = _walls(corners, low, first, *_looks(designs, "ground", "base"), np.ones(len(houses)))
    floors = _walls(corners, first, height, *upper, (height - floor) / floor / 2)
    far = _walls(corners, low, height, *upper, height / floor / 2)
    return Detail(
        _roofs(corners, height, designs), merge((ground_floor, floors, _eaves(corners, height, designs))), far
    )


def _looks(designs: Sequence[Design], layer: str, tint: str) -> tuple[NDArray[np.int_], NDArray[np.int_]]:
    return np.array([int(getattr(d, layer)) for d in designs]), np.array([getattr(d, tint) for d in designs])
