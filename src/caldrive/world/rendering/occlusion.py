"""What of a town can be seen from where: rays over a map of its buildings find the potentially visible cells."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw
from scipy.ndimage import binary_dilation

from caldrive.compiled import compiled, inlined
from caldrive.datatypes import Points
from caldrive.geometry import box_corners
from caldrive.world.scene.scenery import Prop

PIXEL = 2.0  # m of the map
STEP = 4.0  # m along a ray
RAYS = 180
CELL = 12.0  # m, side of a cell
BLOCK = 240.0  # m, of which the sides of a map are multiples
MARGIN = 150.0  # m of map beyond the outermost building
Cells = NDArray[np.int64]  # (N, 2), a point's coordinates divided by CELL and rounded down


class Walls(NamedTuple):
    """A map of walls from its origin (2,) in m on, in pixels of PIXEL m (rows, columns)."""

    origin: Points
    pixels: NDArray[np.bool_]


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
        self._last: tuple[object, Walls] | None = None

    def visible_cells(self, low: Points, high: Points, far: float) -> Cells:
        """Cells that can be seen from anywhere in the rectangle from low (2,) to high (2,), up to far, in m; with the
        cells around them."""
        lowest, highest = np.maximum(low - far, self._low), np.minimum(high + far, self._high)
        walls = self._walls_of_block(lowest, highest)
        (x0, y0), (x1, y1) = low, high
        eyes = np.array([(x0, y0), (x1, y0), (x0, y1), (x1, y1), ((x0 + x1) / 2, (y0 + y1) / 2)])
        origin = np.floor(lowest / CELL) * CELL
        columns, rows = np.maximum(np.ceil((highest - origin) / CELL), 1).astype(int)
        seen = np.zeros((rows + 2, columns + 2), dtype=bool)
        _look_around(eyes, self._directions, far, walls, origin, seen)
        seen = binary_dilation(seen, np.ones((3, 3)))  # walls that were hit, and what stands out of its own cell
        found_rows, found_columns = np.nonzero(seen)
        found = np.stack((found_columns, found_rows), axis=1)
        return np.asarray(found - 1 + np.rint(origin / CELL).astype(np.int64))

    def _walls_of_block(self, low: Points, high: Points) -> Walls:
        """The map of a block around the rectangle from low (2,) to high (2,), in m; a drive seldom leaves it."""
        block = tuple(np.floor(low / BLOCK).tolist()), tuple(np.ceil(high / BLOCK).tolist())
        if self._last is None or self._last[0] != block:
            self._last = block, self._walls(np.array(block[0]) * BLOCK, np.array(block[1]) * BLOCK)
        return self._last[1]

    def _walls(self, origin: Points, high: Points) -> Walls:
        """The map of the rectangle from its origin (2,), of whole cells, to high (2,), in m."""
        columns, rows = np.maximum(np.ceil((high - origin) / CELL), 1).astype(int) * int(CELL / PIXEL)
        picture = Image.new("L", (int(columns), int(rows)), 0)
        draw = ImageDraw.Draw(picture)
        near = (self._highest >= origin).all(axis=1) & (self._lowest <= high).all(axis=1)
        for house in ((self._houses[near] - origin) / PIXEL - 0.5).reshape(-1, 8).tolist():
            draw.polygon(house, fill=1, outline=1)
        return Walls(origin, np.asarray(picture) > 0)


@compiled
def _look_around(
    eyes: Points, directions: Points, far: float, walls: Walls, origin: Points, seen: NDArray[np.bool_]
) -> None:
    """Writes which cells from an origin (2,) on are seen from some eyes (N, 2) that are in no building; seen has an
    empty cell around it."""
    rows, columns = seen.shape[0] - 2, seen.shape[1] - 2
    for eye in range(len(eyes)):
        for ray in range(len(directions)):
            for k in range(math.ceil(far / STEP)):
                x, y = eyes[eye, 0] + k * STEP * directions[ray, 0], eyes[eye, 1] + k * STEP * directions[ray, 1]
                if _is_wall(walls, x, y):
                    break
                column, row = int((x - origin[0]) / CELL), int((y - origin[1]) / CELL)
                if 0 <= column < columns and 0 <= row < rows:
                    seen[row + 1, column + 1] = True


@inlined
def _is_wall(walls: Walls, x: float, y: float) -> bool:
    """Whether a place lies in a building; those beyond the map do not."""
    column, row = int((x - walls.origin[0]) / PIXEL), int((y - walls.origin[1]) / PIXEL)
    rows, columns = walls.pixels.shape
    return bool(0 <= column < columns and 0 <= row < rows and walls.pixels[row, column])
