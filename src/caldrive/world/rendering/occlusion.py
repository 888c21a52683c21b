"""What of a town can be seen from where: rays over a map of its buildings find the potentially visible cells."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw
from scipy.ndimage import binary_dilation

from caldrive.datatypes import Points
from caldrive.geometry import box_corners
from caldrive.world.scene.scenery import Prop

PIXEL = 2.0  # m of the map
STEP = 4.0  # m along a ray
RAYS = 180
CELL = 12.0  # m, side of a cell
MARGIN = 150.0  # m of map beyond the outermost building
Cells = NDArray[np.int64]  # (N, 2), a point's coordinates divided by CELL and rounded down


class OcclusionMap:
    """A town's buildings as walls for rays at eye level; the map is drawn where somebody looks."""

    def __init__(self, props: Sequence[Prop]) -> None:
        houses = [box_corners(prop.pose, prop.length, prop.width) for prop in props if prop.kind == "building"]
        self._houses = np.array(houses).reshape(-1, 4, 2)
        self._lowest, self._highest = self._houses.min(axis=1), self._houses.max(axis=1)  # corners of each
        corners = self._houses.reshape(-1, 2) if houses else np.zeros((1, 2))
        self._low, self._high = corners.min(axis=0) - MARGIN, corners.max(axis=0) + MARGIN
        angles = (np.arange(RAYS) + 0.5) * math.tau / RAYS
        self._directions = np.stack((np.cos(angles), np.sin(angles)), axis=1)

    def visible_cells(self, low: Points, high: Points, far: float) -> Cells:
        """Cells that can be seen from anywhere in the rectangle from low (2,) to high (2,), up to far, in m; with the
        cells around them."""
        walls = self._walls(np.maximum(low - far, self._low), np.minimum(high + far, self._high))
        (x0, y0), (x1, y1) = low, high
        eyes = np.array([(x0, y0), (x1, y0), (x0, y1), (x1, y1), ((x0 + x1) / 2, (y0 + y1) / 2)])
        eyes = eyes[~walls.at(eyes)]
        s = np.arange(0.0, far, STEP)[:, None]
        points = eyes[:, None, None] + s * self._directions[:, None]  # (eyes, rays, steps, 2)
        hidden = np.maximum.accumulate(walls.at(points), axis=2)
        seen = np.zeros(np.array(walls.pixels.shape) // int(CELL / PIXEL) + 2, dtype=bool)
        column, row = np.moveaxis(((points[~hidden] - walls.origin) / CELL).astype(np.int64), -1, 0)
        inside = (column >= 0) & (column < seen.shape[1] - 2) & (row >= 0) & (row < seen.shape[0] - 2)
        seen[row[inside] + 1, column[inside] + 1] = True
        seen = binary_dilation(seen, np.ones((3, 3)))  # walls that were hit, and what stands out of its own cell
        rows, columns = np.nonzero(seen)
        return np.asarray(np.stack((columns, rows), axis=1) - 1 + np.rint(walls.origin / CELL).astype(np.int64))

    def _walls(self, low: Points, high: Points) -> _Walls:
        """The map of the rectangle from low (2,) to high (2,), in m."""
        origin = np.floor(low / CELL) * CELL
        columns, rows = np.maximum(np.ceil((high - origin) / CELL), 1).astype(int) * int(CELL / PIXEL)
        picture = Image.new("L", (int(columns), int(rows)), 0)
        draw = ImageDraw.Draw(picture)
        near = (self._highest >= low).all(axis=1) & (self._lowest <= high).all(axis=1)
        for house in self._houses[near]:
            draw.polygon([(float(x), float(y)) for x, y in (house - origin) / PIXEL - 0.5], fill=1, outline=1)
        return _Walls(origin, np.asarray(picture) > 0)


class _Walls(NamedTuple):
    """A map of walls from its origin (2,) in m on, in pixels of PIXEL m (rows, columns)."""

    origin: Points
    pixels: NDArray[np.bool_]

    def at(self, points: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Whether points (..., 2) lie in a building; those beyond the map do not."""
        column, row = np.moveaxis(((points - self.origin) / PIXEL).astype(np.int32), -1, 0)
        rows, columns = self.pixels.shape
        inside = (column >= 0) & (column < columns) & (row >= 0) & (row < rows)
        return np.asarray(self.pixels[np.clip(row, 0, rows - 1), np.clip(column, 0, columns - 1)] & inside)
