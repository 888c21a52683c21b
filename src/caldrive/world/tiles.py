"""What of a town can be seen from where: its triangles sorted into tiles, and the tiles in view, nearest first."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from caldrive.world.meshes import Mesh

TILE = 24.0  # m
DETAIL = 45.0  # m within which details are drawn
FAR = 260.0  # m beyond which nothing is drawn


class Level(IntEnum):
    """From how far a tile is drawn."""

    ALWAYS = 0
    NEAR = 1
    FAR = 2


@dataclass(frozen=True)
class View:
    """A camera's footprint on the plane: eye (2,), unit vectors ahead and to the left (2,), tangent of half the view's angle."""

    eye: NDArray[np.float64]
    ahead: NDArray[np.float64]
    left: NDArray[np.float64]
    tangent: float

    def sees(self, centers: NDArray[np.float64], reach: NDArray[np.float64] | float) -> NDArray[np.bool_]:
        """Which circles (N, 2) of a radius reach into the view."""
        d = centers - self.eye
        ahead, beside = d @ self.ahead, np.abs(d @ self.left)
        outside = (beside - ahead * self.tangent) / np.sqrt(1 + self.tangent**2)
        return np.asarray((outside < reach) & (ahead > -reach))


class Tiles:
    """A mesh's triangles by tile and level."""

    def __init__(self, parts: Sequence[tuple[Mesh, Level]]) -> None:
        offsets = np.cumsum([0, *(len(m.vertices) for m, _ in parts)])
        self.vertices = np.concatenate([m.vertices for m, _ in parts])
        triangles = np.concatenate([m.triangles + np.uint32(o) for (m, _), o in zip(parts, offsets, strict=False)])
        level = np.concatenate([np.full(len(m.triangles), lod) for m, lod in parts])
        corners = self.vertices["position"][triangles][..., :2]
        cell = np.floor(corners.mean(axis=1) / TILE).astype(int)
        key = np.column_stack((level, cell))
        cells, inverse = np.unique(key, axis=0, return_inverse=True)
        order = np.argsort(inverse, kind="stable")
        bounds = np.searchsorted(inverse[order], np.arange(len(cells) + 1))
        self.level = cells[:, 0]
        self.center = (cells[:, 1:] + 0.5) * TILE
        away = np.linalg.norm(corners - self.center[inverse][:, None], axis=2).max(axis=1)
        self.reach = np.zeros(len(cells))
        np.maximum.at(self.reach, inverse, away)
        sorted_triangles = triangles[order].astype(np.uint32)
        self.indices = [sorted_triangles[a:b].ravel() for a, b in zip(bounds, bounds[1:], strict=False)]

    def visible(self, view: View, detail: float = DETAIL, far: float = FAR) -> NDArray[np.uint32]:
        """Vertex indices of the triangles in view, from near to far."""
        distance = np.hypot(*(self.center - view.eye).T)
        shown = view.sees(self.center, self.reach) & (distance - self.reach < far)
        shown &= (self.level == Level.ALWAYS) | ((self.level == Level.NEAR) == (distance < detail))
        chosen = np.flatnonzero(shown)
        chosen = chosen[np.argsort(distance[chosen], kind="stable")]
        return np.concatenate([self.indices[k] for k in chosen]) if len(chosen) else np.zeros(0, np.uint32)
