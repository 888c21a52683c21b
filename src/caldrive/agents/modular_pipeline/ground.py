"""Pixels to metres: class probabilities of cameras, seen from above on flat ground.

The frame is the car's: x ahead of its centre, y to its left. A place on the ground is looked up in the picture by the
pinhole's law; nothing stands in the way of what is flat, and what stands up hides the ground behind it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from caldrive.agents.modular_pipeline.scene import SceneClass
from caldrive.compiled import Floats
from caldrive.datatypes import CameraConfig, Points

CELL = 0.25  # m
AHEAD, SIDE = 24.0, 22.0  # m that a grid reaches ahead of the car's centre, and to either side
SHAPE = (round(AHEAD / CELL), round(2 * SIDE / CELL))
NEAREST = 0.5  # m ahead of a camera; nothing nearer is in its picture


def pixels_of(camera: CameraConfig, ground: Points) -> Points:
    """Where points (N, 2) on the ground land in a picture: columns and rows (N, 2) in pixels from the upper left
    corner, whose pixel's middle is (0.5, 0.5); NaN for what lies behind the camera."""
    dx, dy = ground[:, 0] - camera.forward, ground[:, 1] - camera.left
    c, s = math.cos(camera.yaw), math.sin(camera.yaw)
    ahead, left = c * dx + s * dy, -s * dx + c * dy
    ahead = np.where(ahead > NEAREST, ahead, np.nan)
    focal = camera.width / 2 / math.tan(math.radians(camera.fov) / 2)
    return np.stack((camera.width / 2 - focal * left / ahead, camera.height / 2 + focal * camera.up / ahead), axis=1)


def cell_middles() -> Points:
    """Middles (X * Y, 2) of a grid's cells, m."""
    x, y = (np.arange(SHAPE[0]) + 0.5) * CELL, (np.arange(SHAPE[1]) + 0.5) * CELL - SIDE
    return np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)


@dataclass(frozen=True)
class GroundGrid:
    """The ground around the car in cells of CELL m."""

    classes: Floats
    """(X, Y, 5): probabilities of each `SceneClass`; 0 where nothing is seen."""
    seen: NDArray[np.bool_]
    """(X, Y): whether a camera sees it."""

    def at(self, points: Points) -> tuple[Floats, NDArray[np.bool_]]:
        """The probabilities (..., 5) at points (..., 2) in m, between the middles of cells, and whether those are seen
        (...)."""
        x, y = points[..., 0] / CELL - 0.5, (points[..., 1] + SIDE) / CELL - 0.5
        seen = self._sees(np.rint(x).astype(int), np.rint(y).astype(int))
        low_x, low_y = np.floor(x).astype(int), np.floor(y).astype(int)
        total, weights = np.zeros((*x.shape, len(SceneClass)), np.float32), np.full(x.shape, 1e-6, np.float32)
        for i, j in ((0, 0), (0, 1), (1, 0), (1, 1)):
            column, row = low_x + i, low_y + j
            weight = ((1 - np.abs(x - column)) * (1 - np.abs(y - row)) * self._sees(column, row)).astype(np.float32)
            total += weight[..., None] * self.classes[_clipped(column, 0), _clipped(row, 1)]
            weights += weight
        total *= (seen / weights)[..., None].astype(np.float32)
        return total, seen

    def _sees(self, column: NDArray[np.intp], row: NDArray[np.intp]) -> NDArray[np.bool_]:
        """Whether cells by number (...) are there and are seen."""
        inside = (column >= 0) & (column < SHAPE[0]) & (row >= 0) & (row < SHAPE[1])
        return self.seen[_clipped(column, 0), _clipped(row, 1)] & inside


def _clipped(numbers: NDArray[np.intp], axis: int) -> NDArray[np.intp]:
    return np.clip(numbers, 0, SHAPE[axis] - 1)


class GroundView:
    """Pictures of cameras to one grid; where two see the same place, the first counts. size: (H, W) of the pictures of
    class probabilities, which may be coarser than the cameras'."""

    def __init__(self, cameras: Sequence[CameraConfig], size: tuple[int, int]) -> None:
        self.size = size
        self._seen = np.zeros(SHAPE[0] * SHAPE[1], bool)
        self._lookups: list[csr_array] = []
        for camera in cameras:
            lookup, cells = _lookup(camera, size, ~self._seen)
            self._lookups.append(lookup)
            self._seen[cells] = True

    def grid(self, pictures: Sequence[Floats]) -> GroundGrid:
        """The grid of pictures (H, W, 5), one for each camera."""
        parts = [
            lookup @ picture.reshape(-1, len(SceneClass))
            for lookup, picture in zip(self._lookups, pictures, strict=True)
        ]
        classes: Floats = sum(parts[1:], start=parts[0])
        return GroundGrid(classes.reshape(*SHAPE, -1), self._seen.reshape(SHAPE))


def _lookup(
    camera: CameraConfig, size: tuple[int, int], wanted: NDArray[np.bool_]
) -> tuple[csr_array, NDArray[np.intp]]:
    """A matrix (X * Y, H * W) that gives each wanted cell (X * Y,) which a camera sees the mean of the four pixels
    around it, weighted by how near they are; and the numbers of those cells (N,)."""
    height, width = size
    at = pixels_of(camera, cell_middles())
    column, row = at[:, 0] * width / camera.width, at[:, 1] * height / camera.height
    with np.errstate(invalid="ignore"):
        inside = (column >= 0) & (column <= width) & (row >= 0) & (row <= height)
    cells = np.flatnonzero(inside & wanted)
    column, row = np.clip(column[cells] - 0.5, 0, width - 1), np.clip(row[cells] - 0.5, 0, height - 1)
    left, top = np.minimum(column.astype(int), width - 2), np.minimum(row.astype(int), height - 2)
    x, y = column - left, row - top
    pixels = [(top + j) * width + left + i for j in (0, 1) for i in (0, 1)]
    weights = [(y if j else 1 - y) * (x if i else 1 - x) for j in (0, 1) for i in (0, 1)]
    values = np.concatenate(weights).astype(np.float32)
    shape = (SHAPE[0] * SHAPE[1], height * width)
    return csr_array((values, (np.tile(cells, 4), np.concatenate(pixels))), shape=shape), cells
