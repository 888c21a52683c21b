"""Façades as textures, near white so that a building's own colour tints them.

An upper layer shows two bays by two floors, a ground layer four bays by one floor.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from PIL import Image, ImageDraw

from caldrive.world.scene.meshes import RGB
from caldrive.world.scene.patterns import SIZE, Layer, flipped, paving, speckled

_GLASS, _FRAME, _SHADE = (74, 88, 104), (246, 244, 238), (150, 148, 144)

Box = tuple[float, float, float, float]  # left, bottom, right, top in units of the layer


class _Facade:
    """Draws rectangles in units of the layer: x from the left, y from the ground, both in [0, 1]."""

    def __init__(self, color: RGB, rng: np.random.Generator, fine: float = 0.03) -> None:
        self.picture = Image.fromarray(speckled(color, rng, fine, coarse=0.04))
        self.draw = ImageDraw.Draw(self.picture)

    def fill(self, box: Box, color: RGB) -> None:
        """A rectangle of one colour."""
        x0, y0, x1, y1 = (round(v * SIZE) for v in box)
        self.draw.rectangle((x0, SIZE - y1, x1 - 1, SIZE - y0 - 1), fill=color)

    def window(self, box: Box, bars: int = 1, cross: bool = False, glass: RGB = _GLASS) -> None:
        """A window with its frame and sill, so many upright bars, and a crossbar."""
        x0, y0, x1, y1 = box
        self.fill((x0 - 0.018, y0 - 0.018, x1 + 0.018, y1 + 0.018), _FRAME)
        self.fill(box, glass)
        self.fill((x0, y0 + 0.62 * (y1 - y0), x1, y1), (98, 114, 132))
        for i in range(1, bars + 1):
            x = x0 + (x1 - x0) * i / (bars + 1)
            self.fill((x - 0.008, y0, x + 0.008, y1), _FRAME)
        if cross:
            self.fill((x0, (y0 + y1) / 2 - 0.008, x1, (y0 + y1) / 2 + 0.008), _FRAME)
        self.fill((x0 - 0.03, y0 - 0.035, x1 + 0.03, y0 - 0.015), _SHADE)


def _in_grid(facade: _Facade, draw: Callable[[float, float], None]) -> Layer:
    """Draws one window for each of two bays by two floors."""
    for x in (0.25, 0.75):
        for y in (0.0, 0.5):
            draw(x, y)
    return flipped(facade.picture)


def sash(rng: np.random.Generator) -> Layer:
    """Tall windows with shutters (town01)."""
    facade = _Facade((236, 234, 230), rng)

    def bay(x: float, y: float) -> None:
        for side in (-1, 1):
            facade.fill((x + side * 0.13 - 0.035, y + 0.11, x + side * 0.13 + 0.035, y + 0.41), (92, 112, 96))
        facade.window((x - 0.085, y + 0.12, x + 0.085, y + 0.40))

    return _in_grid(facade, bay)


def pane(rng: np.random.Generator) -> Layer:
    """Small cross-barred windows (town01)."""
    facade = _Facade((232, 230, 226), rng)
    layer = _in_grid(facade, lambda x, y: facade.window((x - 0.11, y + 0.15, x + 0.11, y + 0.38), cross=True))
    layer = layer.copy()
    layer[: SIZE // 40] = layer[SIZE // 2 : SIZE // 2 + SIZE // 40] = 190
    return layer


def balcony(rng: np.random.Generator) -> Layer:
    """Windows with balconies (town01)."""
    facade = _Facade((238, 236, 232), rng)

    def bay(x: float, y: float) -> None:
        facade.window((x - 0.10, y + 0.06, x + 0.10, y + 0.42))
        facade.fill((x - 0.17, y + 0.03, x + 0.17, y + 0.06), (170, 168, 164))
        for i in range(9):
            facade.fill((x - 0.16 + i * 0.039, y + 0.06, x - 0.148 + i * 0.039, y + 0.19), (70, 70, 74))
        facade.fill((x - 0.17, y + 0.18, x + 0.17, y + 0.20), (60, 60, 64))

    return _in_grid(facade, bay)


def shop(rng: np.random.Generator) -> Layer:
    """A ground floor with shop windows (town01)."""
    facade = _Facade((196, 190, 182), rng)
    for x, awning in ((0.02, (176, 58, 50)), (0.52, (48, 92, 142))):
        facade.window((x + 0.03, 0.16, x + 0.29, 0.72), bars=2, glass=(62, 70, 78))
        facade.fill((x + 0.34, 0.0, x + 0.43, 0.72), (86, 60, 44))
        facade.fill((x + 0.355, 0.30, x + 0.415, 0.68), (96, 112, 128))
        facade.fill((x, 0.76, x + 0.46, 0.92), awning)
        facade.fill((x + 0.10, 0.81, x + 0.36, 0.87), (238, 232, 214))
    return flipped(facade.picture)


def hall(rng: np.random.Generator) -> Layer:
    """A ground floor with doors (town01)."""
    facade = _Facade((214, 210, 204), rng)
    facade.fill((0, 0, 1, 0.14), (150, 146, 140))
    for x, door in ((0.0, (112, 62, 44)), (0.5, (52, 78, 66))):
        facade.fill((x + 0.055, 0.0, x + 0.205, 0.80), _FRAME)
        facade.fill((x + 0.07, 0.0, x + 0.19, 0.76), door)
        facade.fill((x + 0.09, 0.50, x + 0.17, 0.70), (104, 118, 132))
        facade.window((x + 0.29, 0.30, x + 0.43, 0.78), cross=True)
    facade.fill((0, 0.95, 1, 1), (168, 164, 158))
    return flipped(facade.picture)


def glass(rng: np.random.Generator) -> Layer:
    """A curtain wall (town02)."""
    facade = _Facade((188, 196, 204), rng)
    for i in range(4):
        for j in range(4):
            shade = int(rng.integers(-16, 17))
            glass = (104 + shade, 134 + shade, 158 + shade) if j % 2 else (82 + shade, 108 + shade, 130 + shade)
            facade.fill((i / 4 + 0.012, j / 4 + 0.012, i / 4 + 0.238, j / 4 + 0.238), glass)
    return flipped(facade.picture)


def band(rng: np.random.Generator) -> Layer:
    """Ribbon windows (town02)."""
    facade = _Facade((226, 226, 224), rng)
    for y in (0.0, 0.5):
        facade.fill((0, y + 0.17, 1, y + 0.40), (66, 78, 90))
        facade.fill((0, y + 0.32, 1, y + 0.40), (92, 106, 120))
        facade.fill((0, y + 0.0, 1, y + 0.02), (168, 168, 168))
        for i in range(6):
            facade.fill((i / 6, y + 0.17, i / 6 + 0.018, y + 0.40), (200, 202, 204))
    return flipped(facade.picture)


def loft(rng: np.random.Generator) -> Layer:
    """Brick with factory windows (town02)."""
    facade = _Facade((220, 220, 220), rng)
    bricks = paving((205, 198, 192), joint=1.22, rows=32, columns=12, rng=rng)
    facade.picture.paste(Image.fromarray(bricks))
    for x in (0.25, 0.75):
        for y in (0.0, 0.5):
            facade.fill((x - 0.17, y + 0.08, x + 0.17, y + 0.43), (58, 62, 66))
            for i in range(4):
                for j in range(3):
                    u, v = x - 0.16 + i * 0.082, y + 0.095 + j * 0.11
                    facade.fill((u, v, u + 0.07, v + 0.095), (110, 124, 134) if (i + j) % 3 else (140, 152, 160))
    return flipped(facade.picture)


def lobby(rng: np.random.Generator) -> Layer:
    """A glazed ground floor (town02)."""
    facade = _Facade((150, 152, 156), rng)
    for i in range(4):
        facade.fill((i / 4 + 0.02, 0.04, i / 4 + 0.23, 0.78), (64, 82, 94) if i % 2 else (84, 102, 114))
    facade.fill((0.27, 0.0, 0.48, 0.66), (196, 200, 204))
    facade.fill((0.285, 0.0, 0.37, 0.64), (50, 62, 72))
    facade.fill((0.38, 0.0, 0.465, 0.64), (50, 62, 72))
    facade.fill((0, 0.82, 1, 0.94), (214, 214, 212))
    return flipped(facade.picture)


def dock(rng: np.random.Generator) -> Layer:
    """A ground floor with gates (town02)."""
    facade = _Facade((176, 170, 164), rng)
    for x, gate in ((0.04, (196, 160, 60)), (0.54, (118, 128, 136))):
        facade.fill((x, 0.0, x + 0.30, 0.80), (70, 72, 74))
        for j in range(7):
            facade.fill((x + 0.015, j * 0.11, x + 0.285, j * 0.11 + 0.095), gate)
        facade.window((x + 0.345, 0.34, x + 0.42, 0.76), bars=0)
    return flipped(facade.picture)


def invented(rng: np.random.Generator) -> Layer:
    """Windows of any size in any grid, sometimes with bands or piers between them."""
    facade = _Facade((226, 224, 222), rng, float(rng.uniform(0.02, 0.10)))
    columns, rows = int(rng.integers(1, 7)), 2 * int(rng.integers(1, 3))
    wide, high, sill = rng.uniform(0.3, 0.95), rng.uniform(0.3, 0.9), rng.uniform(0.0, 0.3)
    glass, frame = (tuple(int(v) for v in rng.uniform(low, high, 3)) for low, high in ((40, 150), (120, 250)))
    for x in np.arange(columns) / columns:
        for y in np.arange(rows) / rows:
            left, bottom = float(x + (1 - wide) / 2 / columns), float(y + sill * (1 - high) / rows)
            right, top = float(left + wide / columns), float(bottom + high / rows)
            facade.fill((left - 0.015, bottom - 0.015, right + 0.015, top + 0.015), (frame[0], frame[1], frame[2]))
            facade.fill((left, bottom, right, top), (glass[0], glass[1], glass[2]))
    return flipped(facade.picture)
