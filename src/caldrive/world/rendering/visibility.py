"""What can be seen from where in a town: rays over a map of its buildings."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw
from scipy.ndimage import binary_dilation

from caldrive.geometry import box_corners
from caldrive.world.rendering.lens import View
from caldrive.world.scene.meshes import Mesh
from caldrive.world.scene.scenery import Prop

PIXEL = 2.0  # m of the map
STEP = 4.0  # m along a ray
RAYS = 180
CELL = 12.0  # m, the grain of what is seen
AROUND = 150.0  # m of map beyond the outermost building
Cells = NDArray[np.int64]  # (N, 2), a point's coordinates divided by CELL and rounded down


class Sight:
    """A town's buildings as walls for rays at eye level."""

    def __init__(self, props: Sequence[Prop]) -> None:
        houses = [box_corners(p.pose, p.length, p.width) for p in props if p.kind == "building"]
        corners = np.concatenate(houses) if houses else np.zeros((1, 2))
        self.origin = np.floor((corners.min(axis=0) - AROUND) / CELL) * CELL
        size = np.ceil((corners.max(axis=0) + AROUND - self.origin) / CELL).astype(int) * int(CELL / PIXEL)
        picture = Image.new("L", (int(size[0]), int(size[1])), 0)
        draw = ImageDraw.Draw(picture)
        for house in houses:
            draw.polygon([(float(x), float(y)) for x, y in (house - self.origin) / PIXEL - 0.5], fill=1, outline=1)
        self.walls = np.asarray(picture) > 0
        angles = (np.arange(RAYS) + 0.5) * math.tau / RAYS
        self._directions = np.stack((np.cos(angles), np.sin(angles)), axis=1)

    def seen_from(self, low: NDArray[np.float64], high: NDArray[np.float64], far: float) -> Cells:
        """Cells that can be seen from anywhere in the rectangle low..high (m), with the cells around them."""
        (x0, y0), (x1, y1) = low, high
        eyes = np.array([(x0, y0), (x1, y0), (x0, y1), (x1, y1), ((x0 + x1) / 2, (y0 + y1) / 2)])
        eyes = eyes[~self._at(self.walls, eyes, PIXEL)]
        s = np.arange(0.0, far, STEP)[:, None]
        at = eyes[:, None, None] + s * self._directions[:, None]  # (eyes, rays, steps, 2)
        hit = np.maximum.accumulate(self._at(self.walls, at, PIXEL), axis=2)
        seen = np.zeros(np.array(self.walls.shape) // int(CELL / PIXEL) + 2, dtype=bool)
        column, row = np.moveaxis(((at[~hit] - self.origin) / CELL).astype(np.int64), -1, 0)
        inside = (column >= 0) & (column < seen.shape[1] - 2) & (row >= 0) & (row < seen.shape[0] - 2)
        seen[row[inside] + 1, column[inside] + 1] = True
        seen = binary_dilation(seen, np.ones((3, 3)))  # walls that were hit, and what stands out of its own cell
        rows, columns = np.nonzero(seen)
        return np.asarray(np.stack((columns, rows), axis=1) - 1 + np.rint(self.origin / CELL).astype(np.int64))

    def _at(self, grid: NDArray[np.bool_], points: NDArray[np.float64], pixel: float) -> NDArray[np.bool_]:
        column, row = np.moveaxis(((points - self.origin) / pixel).astype(np.int32), -1, 0)
        rows, columns = grid.shape
        inside = (column >= 0) & (column < columns) & (row >= 0) & (row < rows)
        return np.asarray(grid[np.clip(row, 0, rows - 1), np.clip(column, 0, columns - 1)] & inside)


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
