"""Triangle meshes as numpy arrays: one vertex layout for everything that is drawn, and the primitives."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

from caldrive.datatypes import Semantic

# uv: texture coordinates and layer. normal: 128 + 127 times x, y, z. slot: which part of a car or
# person it is, or the class of what stands still (semantics.py). spare: see the shaders.
VERTEX = np.dtype(
    [("position", "3f4"), ("uv", "3f4"), ("normal", "3u1"), ("slot", "u1"), ("color", "3u1"), ("spare", "u1")]
)

Vertices = NDArray[np.void]
Triangles = NDArray[np.uint32]  # (N, 3), counter-clockwise seen from outside
RGB = tuple[int, int, int]
WHITE: RGB = (255, 255, 255)


@dataclass(frozen=True)
class Mesh:
    """owners (N, 2): the place of the thing that each triangle is part of, where parts must come and go together."""

    vertices: Vertices
    triangles: Triangles
    owners: NDArray[np.float64] | None = None

    def places(self) -> NDArray[np.float64]:
        """Owners, or the triangles' own middles (N, 2)."""
        if self.owners is not None:
            return self.owners
        return np.asarray(self.vertices["position"][self.triangles][..., :2].mean(axis=1), dtype=float)


EMPTY = Mesh(np.zeros(0, VERTEX), np.zeros((0, 3), np.uint32))


@dataclass(frozen=True)
class Detail:
    """A thing's parts: always drawn, only from near, only from afar."""

    always: Mesh = EMPTY
    near: Mesh = EMPTY
    far: Mesh = EMPTY


def from_hex(*numbers: int) -> tuple[RGB, ...]:
    """Colours from numbers such as 0xFF8000."""
    return tuple(((number >> 16) & 255, (number >> 8) & 255, number & 255) for number in numbers)


def packed(normal: ArrayLike) -> NDArray[np.float64]:
    """Unit vectors (..., 3) as the bytes of a vertex."""
    return np.asarray(np.rint(128 + 127 * np.asarray(normal, dtype=float)))


def merge(meshes: Iterable[Mesh]) -> Mesh:
    """One mesh from many."""
    parts = [m for m in meshes if len(m.triangles)]
    if not parts:
        return EMPTY
    offsets = np.cumsum([0, *(len(m.vertices) for m in parts[:-1])])
    triangles = [m.triangles + np.uint32(o) for m, o in zip(parts, offsets, strict=True)]
    owners = None if all(m.owners is None for m in parts) else np.concatenate([m.places() for m in parts])
    return Mesh(np.concatenate([m.vertices for m in parts]), np.concatenate(triangles), owners)


def quads(corners: ArrayLike, color: ArrayLike, uv: ArrayLike = (0, 0, 0), slot: int = 0, spare: int = 0) -> Mesh:
    """Flat quadrilaterals from corners (N, 4, 3), counter-clockwise from outside; color (3,) or (N, 3); uv (N, 4, 3).

    Those without area are left out; a corner given twice makes a triangle.
    """
    corners = np.asarray(corners, dtype=float)
    normal = np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
    area = np.linalg.norm(normal, axis=1)
    keep = area > 1e-7
    n = len(corners)
    made = np.zeros((n, 4), VERTEX)
    made["position"] = corners
    made["uv"] = np.broadcast_to(np.asarray(uv, dtype=float), (n, 4, 3))
    made["normal"] = packed(normal / np.maximum(area, 1e-9)[:, None])[:, None]
    made["color"] = np.broadcast_to(np.asarray(color), (n, 3))[:, None]
    made["slot"], made["spare"] = slot, spare
    made = made[keep]
    first = 4 * np.arange(len(made), dtype=np.uint32)[:, None]
    corners_of = np.array([[0, 1, 2], [0, 2, 3]], dtype=np.uint32)
    return Mesh(made.reshape(-1), (first[:, None] + corners_of).reshape(-1, 3).astype(np.uint32))


def box(
    center: tuple[float, float, float], size: tuple[float, float, float], color: RGB,
    layer: int = 0, tile: float = 1.0, slot: int = 0, spare: int = 0, top: float = 1.0,
) -> Mesh:  # fmt: skip
    """A box along the axes without its underside; top: how much of its width and length the upper side has."""
    (x, y, z), (a, b, c) = center, (size[0] / 2, size[1] / 2, size[2] / 2)
    footprint = np.array([(a, -b), (a, b), (-a, b), (-a, -b)])
    low = np.column_stack((footprint + np.array((x, y)), np.full(4, z - c)))
    high = np.column_stack((footprint * top + np.array((x, y)), np.full(4, z + c)))
    sides = np.stack((low, np.roll(low, -1, 0), np.roll(high, -1, 0), high), axis=1)
    uv = np.zeros((5, 4, 3))
    uv[:4, 1:3, 0] = np.array([2 * b, 2 * a, 2 * b, 2 * a])[:, None] / tile
    uv[:4, 2:, 1] = 2 * c / tile
    uv[4, :, :2] = footprint / tile
    uv[..., 2] = layer
    return quads(np.concatenate((sides, high[None])), color, uv, slot, spare)


def _ring(n: int, start: float = 0.0) -> NDArray[np.float64]:
    angles = start + np.arange(n + 1) * math.tau / n
    return np.stack((np.cos(angles), np.sin(angles)), axis=1)


def lathe(
    profile: Sequence[tuple[float, float]], n: int, color: RGB, at: tuple[float, float] = (0.0, 0.0), layer: int = 0,
    slot: int = 0, spare: int = 0, tile: float = 1.0,
) -> Mesh:  # fmt: skip
    """A body of revolution with n flat sides from a profile of (radius, height), from its foot upwards."""
    ring, parts = _ring(n), []
    for (r0, z0), (r1, z1) in pairwise(profile):
        low, high = (np.column_stack((ring * r + at, np.full(n + 1, z))) for r, z in ((r0, z0), (r1, z1)))
        u = np.arange(n + 1) * max(r0, r1) * math.tau / n / tile
        uv = np.zeros((n, 4, 3))
        uv[..., 0] = np.stack((u[:-1], u[1:], u[1:], u[:-1]), axis=1)
        uv[..., 1] = np.array([z0, z0, z1, z1]) / tile
        uv[..., 2] = layer
        parts.append(quads(np.stack((low[:-1], low[1:], high[1:], high[:-1]), axis=1), color, uv, slot, spare))
    return merge(parts)


def disc(
    center: tuple[float, float, float], radius: float, n: int, color: RGB, facing: int = 1, layer: int = 0,
    slot: int = 0, spare: int = 0, axis: str = "x",
) -> Mesh:  # fmt: skip
    """A flat disc that looks along +axis or -axis; uv cover [0, 1]², u to the right for who looks at it."""
    ring = _ring(n, math.pi / n)[:-1]
    hub = ring[[0]] * 0
    sectors = np.stack((np.repeat(hub, n, 0), ring, np.roll(ring, -1, 0), np.roll(ring, -1, 0)), axis=1)
    uv = np.concatenate((sectors / 2 + 0.5, np.full((n, 4, 1), float(layer))), axis=2)
    u, v = sectors[..., 0] * radius, sectors[..., 1] * radius
    zero = np.zeros_like(u)
    along_x, along_y = np.stack((zero, u * facing, v), axis=2), np.stack((-u * facing, zero, v), axis=2)
    return quads((along_x if axis == "x" else along_y) + np.asarray(center), color, uv, slot, spare)


def smooth(mesh: Mesh, center: tuple[float, float, float], squash: float = 1.0) -> Mesh:
    """Rounds a mesh's shading: normals point away from a centre."""
    made = mesh.vertices.copy()
    away = (made["position"] - np.asarray(center)) * (1, 1, squash)
    made["normal"] = packed(away / np.maximum(np.linalg.norm(away, axis=1, keepdims=True), 1e-9))
    return Mesh(made, mesh.triangles)


def classed(mesh: Mesh, semantic: Semantic) -> Mesh:
    """The mesh with a class on all vertices that have none yet."""
    made = mesh.vertices.copy()
    made["slot"][made["slot"] == 0] = semantic
    return replace(mesh, vertices=made)


def classed_detail(detail: Detail, semantic: Semantic) -> Detail:
    """The same for all parts of a thing."""
    return Detail(*(classed(mesh, semantic) for mesh in (detail.always, detail.near, detail.far)))
