"""Procedural textures of surfaces: asphalt, paving, grass, leaves. Layers are (SIZE, SIZE, 3), bottom row first."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from caldrive.world.scene.meshes import RGB

SIZE = 128  # texels along each side of a layer
Layer = NDArray[np.uint8]  # (SIZE, SIZE, 3)


def noise(rng: np.random.Generator, cells: int, size: int = SIZE) -> NDArray[np.float64]:
    """Smooth value noise (size, size) in [-1, 1] that repeats at its edges; cells: how many waves, about."""
    grid = rng.uniform(-1, 1, (cells, cells))
    at = np.arange(size) * cells / size
    cell, share = at.astype(int), at % 1
    share = share * share * (3 - 2 * share)
    rows = grid[cell] * (1 - share)[:, None] + grid[(cell + 1) % cells] * share[:, None]
    return np.asarray(rows[:, cell] * (1 - share) + rows[:, (cell + 1) % cells] * share)


def speckled(color: RGB, rng: np.random.Generator, fine: float, coarse: float, cells: int = 6) -> Layer:
    """A colour with specks of single texels and with waves, by shares of its brightness; cells: see `noise`."""
    return _shaded(color, coarse * noise(rng, cells) + fine * rng.uniform(-1, 1, (SIZE, SIZE)))


def _shaded(color: RGB, wave: NDArray[np.float64]) -> Layer:
    """A colour, each texel brighter by a share (SIZE, SIZE)."""
    return np.clip(np.asarray(color) * (1 + wave[..., None]), 0, 255).astype(np.uint8)


def asphalt(rng: np.random.Generator) -> Layer:
    """Grey with specks and darker, mended patches."""
    base = speckled((205, 205, 205), rng, fine=0.13, coarse=0.10, cells=5).astype(float)
    patches = noise(rng, 4) + 0.4 * noise(rng, 9)
    base *= np.where(patches > 0.55, 0.86, 1.0)[..., None]
    return base.astype(np.uint8)


def paving(color: RGB, joint: float, rows: int, columns: int, rng: np.random.Generator) -> Layer:
    """Stones in a running bond, each with its own shade; joint: brightness of the joints, as a share."""
    y, x = np.mgrid[0:SIZE, 0:SIZE] / SIZE
    row = (y * rows).astype(int)
    column = ((x * columns + 0.5 * (row % 2)) % columns).astype(int)
    shade = 1 + 0.10 * rng.uniform(-1, 1, (rows, columns))[row, column] + 0.05 * rng.uniform(-1, 1, (SIZE, SIZE))
    u, v = (x * columns + 0.5 * (row % 2)) % 1, (y * rows) % 1
    edge = np.minimum(np.minimum(u, 1 - u) / columns, np.minimum(v, 1 - v) / rows) * SIZE < 0.9
    return np.asarray(
        np.clip(np.asarray(color) * (shade * np.where(edge, joint, 1.0))[..., None], 0, 255), dtype=np.uint8
    )


def leaves(color: RGB, rng: np.random.Generator, cells: int) -> Layer:
    """A colour with waves of two sizes: grass or foliage; cells: see `noise`."""
    wave = 0.30 * noise(rng, cells) + 0.22 * noise(rng, 2 * cells) + 0.10 * rng.uniform(-1, 1, (SIZE, SIZE))
    return _shaded(color, wave)


def flipped(picture: Image.Image) -> Layer:
    """A picture as a layer: bottom row first."""
    return np.asarray(picture)[::-1]
