"""Buildings as meshes, all of a town at once: façades by style and variant, tiled hip roofs or flat ones."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from caldrive.datatypes import Points
from caldrive.geometry import box_corners
from caldrive.world.meshes import RGB, Detail, Mesh, merge, quads
from caldrive.world.scenery import STYLES, Prop
from caldrive.world.textures import Tex

BAY = 5.6  # m of façade in one layer: two bays upstairs, four half-width ones on the ground floor
EAVES = 0.35
FULL = 255  # vertices of walls look up shadows of buildings only, a little in front of themselves


@dataclass(frozen=True)
class Design:
    """One type of building: layers of the upper floors and the ground floor, tints, and the roof's rise in metres."""

    upper: Tex
    ground: Tex
    tint: RGB
    base: RGB
    roof: Tex
    roof_tint: RGB
    rise: float


DESIGNS = {
    "town01": (
        Design(Tex.SASH, Tex.HALL, (244, 222, 170), (226, 214, 196), Tex.TILES, (196, 96, 70), 2.6),
        Design(Tex.PANE, Tex.SHOP, (236, 190, 164), (240, 226, 214), Tex.TILES, (176, 84, 64), 2.2),
        Design(Tex.BALCONY, Tex.SHOP, (240, 236, 226), (230, 226, 222), Tex.TILES, (150, 78, 62), 2.4),
        Design(Tex.SASH, Tex.SHOP, (206, 218, 206), (226, 230, 222), Tex.TILES, (120, 92, 84), 2.8),
        Design(Tex.PANE, Tex.HALL, (214, 168, 140), (206, 196, 184), Tex.TILES, (188, 92, 66), 3.0),
        Design(Tex.BALCONY, Tex.HALL, (190, 206, 222), (218, 218, 218), Tex.TILES, (132, 76, 66), 2.2),
    ),
    "town02": (
        Design(Tex.GLASS, Tex.LOBBY, (226, 240, 250), (236, 240, 244), Tex.PLAIN, (132, 134, 138), 0.0),
        Design(Tex.BAND, Tex.LOBBY, (214, 212, 206), (232, 232, 232), Tex.PLAIN, (120, 120, 122), 0.0),
        Design(Tex.LOFT, Tex.DOCK, (178, 104, 84), (206, 190, 180), Tex.PLAIN, (110, 100, 96), 0.0),
        Design(Tex.BAND, Tex.DOCK, (160, 172, 178), (214, 214, 212), Tex.PLAIN, (96, 100, 104), 0.0),
        Design(Tex.LOFT, Tex.LOBBY, (148, 128, 118), (214, 210, 206), Tex.PLAIN, (92, 90, 90), 0.0),
        Design(Tex.GLASS, Tex.DOCK, (206, 216, 206), (200, 204, 200), Tex.PLAIN, (128, 130, 128), 0.0),
    ),
}


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


def building_meshes(props: Sequence[Prop], style: str) -> Detail:
    """All buildings among the props; from afar their ground floors look like the others."""
    houses = [p for p in props if p.kind == "building"]
    if not houses:
        return Detail()
    designs = [DESIGNS[style][p.variant] for p in houses]
    # from front right counter-clockwise, so that the walls look outwards
    footprints: list[Points] = [np.roll(box_corners(p.pose, p.length, p.width), 1, axis=0) for p in houses]
    corners, height = np.array(footprints), np.array([p.height for p in houses])
    floor = STYLES[style].floor
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
