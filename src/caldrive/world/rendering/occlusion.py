"""What of a town can be seen from where: rays over a map of its buildings find the potentially visible cells."""

from __future__ import annotations

import math
from collections.abc import Sequence

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
    """A town's buildings as walls for rays at eye level."""

    def __init__(self, props: Sequence[Prop]) -> None:
        houses = [box_corners(prop.pose, prop.length, prop.width) for prop in props if prop.kind == "building"]
        corners = np.concatenate(houses) if houses else np.zeros((1, 2))
        self.origin = np.floor((corners.min(axis=0) - MARGIN) / CELL) * CELL
        size = np.ceil((corners.max(axis=0) + MARGIN - self.origin) / CELL).astype(int) * int(CELL / PIXEL)
        picture = Image.new("L", (int(size[0]), int(size[1])), 0)
        draw = ImageDraw.Draw(picture)
        for house in houses:
            draw.polygon([(float(x), float(y)) for x, y in (house - self.origin) / PIXEL - 0.5], fill=1, outline=1)
        self.walls = np.asarray(picture) > 0
        angles = (np.arange(RAYS) + 0.5) * math.tau / RAYS
        self._directions = np.stack((np.cos(angles), np.sin(angles)), axis=1)

    def visible_cells(self, low: Points, high: Points, far: float) -> Cells:
        """Cells that can be seen from anywhere in the rectangle from low (2,) to high (2,), up to far, in m; with the
        cells around them."""
        (x0, y0), (x1, y1) = low, high
        eyes = np.array([(x0, y0), (x1, y0), (x0, y1), (x1, y1), ((x0 + x1) / 2, (y0 + y1) / 2)])
        eyes = eyes[~self._is_wall(eyes)]
        s = np.arange(0.0, far, STEP)[:, None]
        points = eyes[:, None, None] + s * self._directions[:, None]  # (eyes, rays, steps, 2)
        hidden = np.maximum.accumulate(self._is_wall(points), axis=2)
        seen = np.zeros(np.array(self.walls.shape) // int(CELL / PIXEL) + 2, dtype=bool)
        column, row = np.moveaxis(((points[~hidden] - self.origin) / CELL).astype(np.int64), -1, 0)
        inside = (column >= 0) & (column < seen.shape[1] - 2) & (row >= 0) & (row < seen.shape[0] - 2)
        seen[row[inside] + 1, column[inside] + 1] = True
        seen = binary_dilation(seen, np.ones((3, 3)))  # walls that were hit, and what stands out of its own cell
        rows, columns = np.nonzero(seen)
        return np.asarray(np.stack((columns, rows), axis=1) - 1 + np.rint(self.origin / CELL).astype(np.int64))

    def _is_wall(self, points: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Whether points (..., 2) lie in a building; those beyond the map do not."""
        column, row = np.moveaxis(((points - self.origin) / PIXEL).astype(np.int32), -1, 0)
        rows, columns = self.walls.shape
        inside = (column >= 0) & (column < columns) & (row >= 0) & (row < rows)
        return np.asarray(self.walls[np.clip(row, 0, rows - 1), np.clip(column, 0, columns - 1)] & inside)
