"""Triangle meshes as numpy arrays: one vertex layout for everything that stands in a town, and the primitives."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from caldrive.datatypes import Pose

# uv: texture coordinates and layer. normal: x, y, z times 127 and a spare byte. color: RGB and a spare byte.
VERTEX = np.dtype([("position", "3f4"), ("uv", "3f4"), ("normal", "4i1"), ("color", "4u1")])
Vertices = NDArray[np.void]
Triangles = NDArray[np.uint32]  # (N, 3), counter-clockwise seen from outside
RGB = tuple[int, int, int]


@dataclass(frozen=True)
class Mesh:
    vertices: Vertices
    triangles: Triangles


EMPTY = Mesh(np.zeros(0, VERTEX), np.zeros((0, 3), np.uint32))


def vertices(
    position: ArrayLike, normal: ArrayLike, color: ArrayLike, uv: ArrayLike = (0, 0, 0), spare: ArrayLike = 0
) -> Vertices:
    """Vertices from arrays that broadcast over positions (N, 3); normal (N, 3) of unit length; color 0 to 255."""
    position = np.asarray(position, dtype=np.float32)
    made = np.zeros(len(position), VERTEX)
    made["position"] = position
    made["uv"] = uv
    made["normal"][:, :3] = np.rint(np.asarray(normal, dtype=float) * 127)
    made["normal"][:, 3] = spare
    made["color"][:, :3] = color
    made["color"][:, 3] = 255
    return made


def merge(meshes: Iterable[Mesh]) -> Mesh:
    """One mesh from many."""
    parts = [m for m in meshes if len(m.triangles)]
    if not parts:
        return EMPTY
    offsets = np.cumsum([0, *(len(m.vertices) for m in parts[:-1])])
    triangles = [m.triangles + np.uint32(o) for m, o in zip(parts, offsets, strict=True)]
    return Mesh(np.concatenate([m.vertices for m in parts]), np.concatenate(triangles).astype(np.uint32))


def quads(corners: ArrayLike, color: ArrayLike, uv: ArrayLike = (0, 0, 0)) -> Mesh:
    """Flat quadrilaterals from corners (N, 4, 3), counter-clockwise from outside; color (3,) or (N, 3); uv (N, 4, 3)."""
    corners = np.asarray(corners, dtype=float)
    n = len(corners)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 3] - corners[:, 0])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-9)
    color = np.broadcast_to(np.asarray(color), (n, 3))
    uv = np.broadcast_to(np.asarray(uv, dtype=float), (n, 4, 3))
    made = vertices(corners.reshape(-1, 3), np.repeat(normal, 4, 0), np.repeat(color, 4, 0), uv.reshape(-1, 3))
    first = 4 * np.arange(n, dtype=np.uint32)[:, None]
    return Mesh(made, np.concatenate((first + [0, 1, 2], first + [0, 2, 3]), axis=1).reshape(-1, 3).astype(np.uint32))


def box(center: tuple[float, float, float], size: tuple[float, float, float], color: RGB, layer: int = 0) -> Mesh:
    """A box standing along the axes, without its underside; uv in metres."""
    (x, y, z), (a, b, c) = center, (size[0] / 2, size[1] / 2, size[2] / 2)
    footprint = np.array([(a, -b), (a, b), (-a, b), (-a, -b)])
    low = np.column_stack((footprint + (x, y), np.full(4, z - c)))
    high = low + (0, 0, 2 * c)
    sides = np.stack((low, np.roll(low, -1, 0), np.roll(high, -1, 0), high), axis=1)
    wide = np.array([2 * b, 2 * a, 2 * b, 2 * a])
    uv = np.zeros((5, 4, 3))
    uv[:4, 1:3, 0] = wide[:, None]
    uv[:4, 2:, 1] = 2 * c
    uv[4, :, :2] = footprint
    uv[..., 2] = layer
    return quads(np.concatenate((sides, high[None])), color, uv)


def turned(mesh: Mesh, pose: Pose, height: float = 0.0) -> Mesh:
    """A mesh moved from its own frame to a pose in the world."""
    c, s = math.cos(pose.heading), math.sin(pose.heading)
    turn = np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]])
    moved = mesh.vertices.copy()
    moved["position"] = moved["position"] @ turn + np.array([pose.x, pose.y, height])
    moved["normal"][:, :3] = np.rint(moved["normal"][:, :3] @ turn)
    return Mesh(moved, mesh.triangles)
