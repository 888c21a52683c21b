"""Triangle meshes as numpy arrays: one vertex layout for everything that is drawn, and the primitives."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

from caldrive.datatypes import Semantic

# position in m. uv: texture coordinates and layer. normal: 128 + 127 times x, y, z. slot: the part of a car or person
# that a vertex belongs to, or the semantic class of what stands still. spare: a limb, GLOWING, or BUILDING_SHADOWS.
VERTEX = np.dtype(
    [("position", "3f4"), ("uv", "3f4"), ("normal", "3u1"), ("slot", "u1"), ("color", "3u1"), ("spare", "u1")]
)

Vertices = NDArray[np.void]  # (N,) of VERTEX
Triangles = NDArray[np.uint32]  # (N, 3), counter-clockwise seen from outside
Point = tuple[float, float, float]  # x, y, z in m
RGB = tuple[int, int, int]
WHITE: RGB = (255, 255, 255)
BUILDING_SHADOWS = 255  # in the spare byte: shaded by buildings only, looked up a little in front of the surface


@dataclass(frozen=True)
class Mesh:
    """Triangles (N, 3) over vertices, of which they are numbers."""

    vertices: Vertices
    triangles: Triangles
    owners: NDArray[np.float64] | None = None
    """(N, 2) in m: where the thing stands that each triangle is part of, where parts must come and go together."""

    def places(self) -> NDArray[np.float64]:
        """Owners, or the triangles' own centres (N, 2) in m."""
        if self.owners is not None:
            return self.owners
        return np.asarray(self.vertices["position"][self.triangles][..., :2].mean(axis=1), dtype=float)


EMPTY = Mesh(np.zeros(0, VERTEX), np.zeros((0, 3), np.uint32))


@dataclass(frozen=True)
class LodMesh:
    """A thing in levels of detail: what is drawn always, only from near, only from afar."""

    always: Mesh = EMPTY
    near: Mesh = EMPTY
    far: Mesh = EMPTY


@dataclass(frozen=True)
class Surface:
    """What the faces of a primitive look like."""

    color: RGB
    layer: int = 0
    """Of the texture array, see `textures.Tex`."""
    tile: float = 1.0
    """m of one repetition of the texture."""
    slot: int = 0
    """See VERTEX."""
    spare: int = 0
    """See VERTEX."""


def from_hex(*numbers: int) -> tuple[RGB, ...]:
    """Colours from numbers such as 0xFF8000."""
    return tuple(((number >> 16) & 255, (number >> 8) & 255, number & 255) for number in numbers)


def packed(normal: ArrayLike) -> NDArray[np.float64]:
    """Unit vectors (..., 3) as the bytes of a vertex."""
    return np.asarray(np.rint(128 + 127 * np.asarray(normal, dtype=float)))


def merge(meshes: Iterable[Mesh]) -> Mesh:
    """One mesh from many, their triangles in order."""
    parts = [mesh for mesh in meshes if len(mesh.triangles)]
    if not parts:
        return EMPTY
    offsets = np.cumsum([0, *(len(mesh.vertices) for mesh in parts[:-1])])
    triangles = [mesh.triangles + np.uint32(offset) for mesh, offset in zip(parts, offsets, strict=True)]
    owned = any(mesh.owners is not None for mesh in parts)
    owners = np.concatenate([mesh.places() for mesh in parts]) if owned else None
    return Mesh(np.concatenate([mesh.vertices for mesh in parts]), np.concatenate(triangles), owners)


def quads(corners: ArrayLike, color: ArrayLike, uv: ArrayLike = (0, 0, 0), slot: int = 0, spare: int = 0) -> Mesh:
    """Flat quadrilaterals from corners (N, 4, 3) in m, counter-clockwise from outside; color (3,) or (N, 3); uv
    (N, 4, 3).

    Those without area are left out; a corner given twice makes a triangle.
    """
    corners = np.asarray(corners, dtype=float)
    normal = np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
    area = np.linalg.norm(normal, axis=1)
    n = len(corners)
    vertices = np.zeros((n, 4), VERTEX)
    vertices["position"] = corners
    vertices["uv"] = np.broadcast_to(np.asarray(uv, dtype=float), (n, 4, 3))
    vertices["normal"] = packed(normal / np.maximum(area, 1e-9)[:, None])[:, None]
    vertices["color"] = np.broadcast_to(np.asarray(color), (n, 3))[:, None]
    vertices["slot"], vertices["spare"] = slot, spare
    return mesh_of_quads(vertices[area > 1e-7])


def mesh_of_quads(vertices: Vertices) -> Mesh:
    """Two triangles for each four vertices (N, 4)."""
    first = 4 * np.arange(len(vertices), dtype=np.uint32)[:, None, None]
    triangles = first + np.array([[0, 1, 2], [0, 2, 3]], np.uint32)
    return Mesh(vertices.reshape(-1), triangles.reshape(-1, 3).astype(np.uint32))


def box(center: Point, size: Point, surface: Surface, top: float = 1.0) -> Mesh:
    """A box along the axes, without its underside. size: along x, y and z in m; top: how much of its length and width
    the upper side has."""
    (x, y, z), (a, b, c), tile = center, (size[0] / 2, size[1] / 2, size[2] / 2), surface.tile
    footprint = np.array([(a, -b), (a, b), (-a, b), (-a, -b)])
    low = np.column_stack((footprint + np.array((x, y)), np.full(4, z - c)))
    high = np.column_stack((footprint * top + np.array((x, y)), np.full(4, z + c)))
    sides = np.stack((low, np.roll(low, -1, 0), np.roll(high, -1, 0), high), axis=1)
    uv = np.zeros((5, 4, 3))
    uv[:4, 1:3, 0] = np.array([2 * b, 2 * a, 2 * b, 2 * a])[:, None] / tile
    uv[:4, 2:, 1] = 2 * c / tile
    uv[4, :, :2] = footprint / tile
    uv[..., 2] = surface.layer
    return quads(np.concatenate((sides, high[None])), surface.color, uv, surface.slot, surface.spare)


def _ring(n: int, start: float = 0.0) -> NDArray[np.float64]:
    """n + 1 points (n + 1, 2) around the unit circle, the last one on the first; start: rad of the first."""
    angles = start + np.arange(n + 1) * math.tau / n
    return np.stack((np.cos(angles), np.sin(angles)), axis=1)


def lathe(
    profile: Sequence[tuple[float, float]], n: int, surface: Surface, at: tuple[float, float] = (0.0, 0.0)
) -> Mesh:
    """A body of revolution with n flat sides from a profile of (radius, height) in m, from its foot upwards. at: x, y
    of its axis."""
    ring, parts, tile = _ring(n), [], surface.tile
    for (r0, z0), (r1, z1) in pairwise(profile):
        low, high = (np.column_stack((ring * r + at, np.full(n + 1, z))) for r, z in ((r0, z0), (r1, z1)))
        u = np.arange(n + 1) * max(r0, r1) * math.tau / n / tile
        uv = np.zeros((n, 4, 3))
        uv[..., 0] = np.stack((u[:-1], u[1:], u[1:], u[:-1]), axis=1)
        uv[..., 1] = np.array([z0, z0, z1, z1]) / tile
        uv[..., 2] = surface.layer
        corners = np.stack((low[:-1], low[1:], high[1:], high[:-1]), axis=1)
        parts.append(quads(corners, surface.color, uv, surface.slot, surface.spare))
    return merge(parts)


def disc(center: Point, radius: float, n: int, surface: Surface, facing: int = 1, axis: str = "x") -> Mesh:
    """A flat disc of n sectors that looks along +axis (facing 1) or -axis (-1); uv cover [0, 1]², u to the right as
    one looks at it."""
    ring = _ring(n, math.pi / n)[:-1]
    hub = ring[[0]] * 0
    sectors = np.stack((np.repeat(hub, n, 0), ring, np.roll(ring, -1, 0), np.roll(ring, -1, 0)), axis=1)
    uv = np.concatenate((sectors / 2 + 0.5, np.full((n, 4, 1), float(surface.layer))), axis=2)
    u, v = sectors[..., 0] * radius, sectors[..., 1] * radius
    zero = np.zeros_like(u)
    along_x, along_y = np.stack((zero, u * facing, v), axis=2), np.stack((-u * facing, zero, v), axis=2)
    corners = (along_x if axis == "x" else along_y) + np.asarray(center)
    return quads(corners, surface.color, uv, surface.slot, surface.spare)


def smooth(mesh: Mesh, center: Point, squash: float = 1.0) -> Mesh:
    """Rounds a mesh's shading: normals point away from a centre; squash: weight of their z."""
    vertices = mesh.vertices.copy()
    away = (vertices["position"] - np.asarray(center)) * (1, 1, squash)
    vertices["normal"] = packed(away / np.maximum(np.linalg.norm(away, axis=1, keepdims=True), 1e-9))
    return Mesh(vertices, mesh.triangles)


def with_class(mesh: Mesh, semantic: Semantic) -> Mesh:
    """The mesh with a semantic class on all vertices that have none yet."""
    vertices = mesh.vertices.copy()
    vertices["slot"][vertices["slot"] == 0] = semantic
    return replace(mesh, vertices=vertices)


def lod_with_class(lod: LodMesh, semantic: Semantic) -> LodMesh:
    """The same for all levels of detail."""
    return LodMesh(*(with_class(mesh, semantic) for mesh in (lod.always, lod.near, lod.far)))
