"""What of a town is drawn from where: the tiles in sight of a place, and of these the triangles that face the eye."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from caldrive.world.meshes import Mesh
from caldrive.world.sight import CELL, Cells

DETAIL = 32.0  # m within which details are drawn
EVERYWHERE = 100.0  # m: larger triangles belong to no tile
KEPT = 128  # places whose triangles are remembered

Floats = NDArray[np.float32]


class Level(IntEnum):
    """From how far a mesh is drawn."""

    ALWAYS = 0
    NEAR = 1
    FAR = 2


@dataclass(frozen=True)
class View:
    """What a camera covers: eye (3,), unit vectors ahead and to the left (2,), tangent of half the view's angle."""

    eye: NDArray[np.float64]
    ahead: NDArray[np.float64]
    left: NDArray[np.float64]
    tangent: float

    def sees(self, at: NDArray[np.floating], reach: NDArray[np.floating] | float) -> NDArray[np.bool_]:
        """Which circles around points (N, 2) of the plane reach into the view."""
        slope = math.sqrt(1 + self.tangent**2)
        sides = np.stack((self.ahead, self.left)).astype(at.dtype)
        ahead, beside = sides @ at.T - (sides @ self.eye[:2].astype(at.dtype))[:, None]
        return np.asarray((np.abs(beside) - ahead * at.dtype.type(self.tangent) < reach * slope) & (ahead > -reach))


@dataclass(frozen=True)
class Place:
    """A small box of eye positions: within it one decision holds on which tiles are in sight, and in which detail."""

    low: tuple[float, float, float]
    size: float
    detail: float

    @classmethod
    def around(cls, eye: NDArray[np.float64], size: float, detail: float) -> Place:
        x, y, z = (float(v) for v in np.floor(eye / size) * size)
        return cls((x, y, z), size, detail)

    @property
    def middle(self) -> NDArray[np.float64]:
        return np.array(self.low)[:2] + self.size / 2

    @property
    def corners(self) -> NDArray[np.float64]:
        """The box's corners (8, 3)."""
        steps = np.stack(np.meshgrid((0, 1), (0, 1), (0, 1)), axis=-1).reshape(-1, 3)
        return np.array(self.low) + self.size * steps


@dataclass(frozen=True)
class _Faces:
    """Triangles with what is needed to leave some out: planes (n, n·p), middles and radii on the plane."""

    triangles: NDArray[np.uint32]  # (N, 3)
    planes: Floats  # (N, 4)
    middles: Floats  # (N, 2)
    reach: Floats  # (N,)

    def facing(self, eyes: NDArray[np.float64]) -> _Faces:
        """Those that face at least one of some eyes (N, 3)."""
        return self.take(
            np.flatnonzero((self.planes @ np.column_stack((eyes, np.ones(len(eyes)))).T > -1e-3).any(axis=1))
        )

    def take(self, chosen: NDArray[np.int64]) -> _Faces:
        return _Faces(self.triangles[chosen], self.planes[chosen], self.middles[chosen], self.reach[chosen])


def _faces(vertices: NDArray[np.void], triangles: NDArray[np.uint32]) -> _Faces:
    corners = vertices["position"][triangles]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    flat = corners[..., :2]
    middles = flat.mean(axis=1)
    reach = np.sqrt(((flat - middles[:, None]) ** 2).sum(axis=2).max(axis=1))
    planes = np.column_stack((normal, -(normal * corners[:, 0]).sum(axis=1)))
    return _Faces(triangles, planes, middles, reach)


class Tiles:
    """Meshes whose triangles are sorted into square tiles."""

    def __init__(self, parts: Sequence[tuple[Mesh, Level]]) -> None:
        parts = [(m, level) for m, level in parts if len(m.triangles)]
        offsets = np.cumsum([0, *(len(m.vertices) for m, _ in parts)])
        self.vertices = np.concatenate([m.vertices for m, _ in parts])
        triangles = np.concatenate([m.triangles + np.uint32(o) for (m, _), o in zip(parts, offsets, strict=False)])
        faces = _faces(self.vertices, triangles)
        level = np.concatenate([np.full(len(m.triangles), lod) for m, lod in parts])
        tile = np.column_stack((level, np.floor(np.concatenate([m.places() for m, _ in parts]) / CELL).astype(int)))
        tile[faces.reach > EVERYWHERE] = -1, 0, 0
        self.tiles, which = np.unique(tile, axis=0, return_inverse=True)
        order = np.argsort(which, kind="stable")
        self.bounds = np.searchsorted(which[order], np.arange(len(self.tiles) + 1))
        self.faces = faces.take(order)
        self._remembered: dict[Place, _Faces] = {}

    def visible(self, view: View, place: Place, seen: Callable[[], Cells | None], far: float) -> NDArray[np.uint32]:
        """Triangles (N, 3) in view that face the eye. seen: the cells in sight of the place, None for all."""
        if place not in self._remembered:
            if len(self._remembered) >= KEPT:
                self._remembered.pop(next(iter(self._remembered)))
            self._remembered[place] = self._near(seen(), place.middle, place.detail, far).facing(place.corners)
        faces = self._remembered[place]
        front = faces.planes @ np.array((*view.eye, 1.0), np.float32) > 0
        return faces.triangles[front & view.sees(faces.middles, faces.reach)]

    def _near(self, cells: Cells | None, center: NDArray[np.float64], detail: float, far: float) -> _Faces:
        """Faces of the tiles in sight, nearest first; those that belong to no tile come last."""
        level = self.tiles[:, 0]
        distance = np.hypot(*((self.tiles[:, 1:] + 0.5) * CELL - center).T)
        shown = (distance < far) & ((level == Level.ALWAYS) | ((level == Level.NEAR) == (distance < detail)))
        if cells is not None:
            shown &= np.isin(_key(self.tiles[:, 1:]), _key(cells))
        shown |= level < 0
        distance[level < 0] = np.inf
        chosen = np.flatnonzero(shown)
        chosen = chosen[np.argsort(distance[chosen], kind="stable")]
        ranges = [np.arange(self.bounds[k], self.bounds[k + 1]) for k in chosen]
        return self.faces.take(np.concatenate(ranges) if ranges else np.zeros(0, np.int64))


def _key(cells: Cells) -> NDArray[np.int64]:
    return np.asarray(cells[:, 0] * 100_003 + cells[:, 1])
