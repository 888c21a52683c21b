"""Which triangles of a town may be seen from a small place: those of the tiles in sight from there, in the level of
detail of their distance, that face one of its corners."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from caldrive.datatypes import Points
from caldrive.world.rendering.occlusion import CELL, Cells
from caldrive.world.scene.meshes import Mesh, Triangles, Vertices, merge

LARGE = 100.0  # m: larger triangles belong to no tile
KEPT = 128  # view cells whose triangles are remembered
NO_TILE = -1  # in the place of a level
Floats = NDArray[np.float32]


class DetailLevel(IntEnum):
    """From how far a mesh is drawn."""

    ALWAYS = 0
    NEAR = 1
    FAR = 2


@dataclass(frozen=True)
class ViewCell:
    """A cube of eye positions: within it one decision holds on which tiles are in sight, and in which detail."""

    low: tuple[float, float, float]
    """Its lowest corner, m."""
    size: float
    """Its side, m."""
    detail: float
    """m within which the NEAR meshes are drawn."""

    @classmethod
    def around(cls, eye: tuple[float, float, float], size: float, detail: float) -> ViewCell:
        """The one that an eye is in."""
        x, y, z = (math.floor(value / size) * size for value in eye)
        return cls(low=(x, y, z), size=size, detail=detail)

    @property
    def middle(self) -> Points:
        """Its centre (2,) on the plane."""
        return np.array(self.low)[:2] + self.size / 2

    @property
    def corners(self) -> NDArray[np.float64]:
        """(8, 3)."""
        steps = np.stack(np.meshgrid((0, 1), (0, 1), (0, 1)), axis=-1).reshape(-1, 3)
        return np.array(self.low) + self.size * steps


class Faces(NamedTuple):
    """Triangles with what is needed to leave some out."""

    triangles: Triangles
    """(N, 3)."""
    planes: Floats
    """(N, 4): normal n, and n·p with its sign turned."""
    middles: Floats
    """(N, 2), m."""
    reach: Floats
    """(N,) m from the middle to the farthest corner, on the plane."""

    def facing(self, eyes: NDArray[np.float64]) -> Faces:
        """Those that face at least one of some eyes (M, 3)."""
        heights = self.planes @ np.column_stack((eyes, np.ones(len(eyes)))).T
        return self.take(np.flatnonzero((heights > -1e-3).any(axis=1)))

    def take(self, chosen: NDArray[np.int64]) -> Faces:
        """Those with some numbers, in their order."""
        return Faces(self.triangles[chosen], self.planes[chosen], self.middles[chosen], self.reach[chosen])


def _faces(vertices: Vertices, triangles: Triangles) -> Faces:
    corners = vertices["position"][triangles]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    flat = corners[..., :2]
    middles = flat.mean(axis=1)
    reach = np.sqrt(((flat - middles[:, None]) ** 2).sum(axis=2).max(axis=1))
    planes = np.column_stack((normal, -(normal * corners[:, 0]).sum(axis=1)))
    return Faces(triangles, planes.astype(np.float32), middles, reach)


class TileGrid:
    """Meshes whose triangles are sorted into square tiles. vertices: of all of them."""

    def __init__(self, parts: Sequence[tuple[Mesh, DetailLevel]]) -> None:
        parts = [(mesh, level) for mesh, level in parts if len(mesh.triangles)]
        whole = merge(mesh for mesh, _ in parts)
        self.vertices, faces = whole.vertices, _faces(whole.vertices, whole.triangles)
        level = np.repeat([level for _, level in parts], [len(mesh.triangles) for mesh, _ in parts])
        keys = np.column_stack((level, np.floor(whole.places() / CELL).astype(int)))  # level and cell of each triangle
        keys[faces.reach > LARGE] = NO_TILE, 0, 0
        self.tiles, tile_of = np.unique(keys, axis=0, return_inverse=True)
        order = np.argsort(tile_of, kind="stable")
        self.bounds = np.searchsorted(tile_of[order], np.arange(len(self.tiles) + 1))
        self.faces = faces.take(order)
        self._remembered: dict[ViewCell, Faces] = {}

    def seen_from(self, view_cell: ViewCell, cells_in_sight: Callable[[], Cells | None], far: float) -> Faces:
        """Faces up to far (m) that may be seen from somewhere in a view cell, the nearest first. cells_in_sight: what
        can be seen from there, None for all; asked once for each view cell."""
        if view_cell not in self._remembered:
            if len(self._remembered) >= KEPT:
                self._remembered.pop(next(iter(self._remembered)))
            self._remembered[view_cell] = self._in_sight(cells_in_sight(), view_cell, far).facing(view_cell.corners)
        return self._remembered[view_cell]

    def _in_sight(self, cells: Cells | None, view_cell: ViewCell, far: float) -> Faces:
        """Faces of the tiles in sight, nearest first; those that belong to no tile come last."""
        level = self.tiles[:, 0]
        distance = np.hypot(*((self.tiles[:, 1:] + 0.5) * CELL - view_cell.middle).T)
        is_near = distance < view_cell.detail
        drawn = (distance < far) & ((level == DetailLevel.ALWAYS) | ((level == DetailLevel.NEAR) == is_near))
        if cells is not None:
            drawn &= np.isin(_key(self.tiles[:, 1:]), _key(cells))
        drawn |= level == NO_TILE
        distance[level == NO_TILE] = np.inf
        chosen = np.flatnonzero(drawn)
        chosen = chosen[np.argsort(distance[chosen], kind="stable")]
        sizes = self.bounds[chosen + 1] - self.bounds[chosen]
        before = np.cumsum(sizes) - sizes  # how many faces the tiles before have
        return self.faces.take(np.arange(sizes.sum()) + np.repeat(self.bounds[chosen] - before, sizes))


def _key(cells: Cells) -> NDArray[np.int64]:
    """One number (N,) for each cell."""
    return np.asarray(cells[:, 0] * 100_003 + cells[:, 1])
