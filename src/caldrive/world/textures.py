"""The texture array: surfaces, façades and signs, drawn once at start from a fixed seed.

Façades are near white, so that a building's own colour tints them. One façade layer shows two bays by two floors (upper
floors) or four bays by one floor (ground floors, drawn at half height in the layer's full square).
"""

from __future__ import annotations

from collections.abc import Callable
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

SIZE = 128
Layer = NDArray[np.uint8]  # (SIZE, SIZE, 3), bottom row first


class Tex(IntEnum):
    """Layers of the array."""

    PLAIN = 0
    ASPHALT = 1
    SLABS = 2
    BRICKS = 3
    GRASS = 4
    GRAVEL = 5
    LEAVES = 6
    NEEDLES = 7
    TILES = 8
    SASH = 9  # town01: tall windows with shutters
    PANE = 10  # town01: small cross-barred windows
    BALCONY = 11  # town01: windows with balconies
    SHOP = 12  # town01: ground floor with shop windows
    HALL = 13  # town01: ground floor with doors
    GLASS = 14  # town02: curtain wall
    BAND = 15  # town02: ribbon windows
    LOFT = 16  # town02: brick with factory windows
    LOBBY = 17  # town02: glazed ground floor
    DOCK = 18  # town02: ground floor with gates
    SIGN_30 = 19
    SIGN_60 = 20
    SIGN_90 = 21
    POSTER_A = 22
    POSTER_B = 23


SIGN_LAYERS = {30: Tex.SIGN_30, 60: Tex.SIGN_60, 90: Tex.SIGN_90}


def noise(rng: np.random.Generator, cells: int, size: int = SIZE) -> NDArray[np.float64]:
    """Smooth noise (size, size) in [-1, 1] that repeats at its edges."""
    grid = rng.uniform(-1, 1, (cells, cells))
    at = np.arange(size) * cells / size
    i, t = at.astype(int), at % 1
    t = t * t * (3 - 2 * t)
    rows = grid[i] * (1 - t)[:, None] + grid[(i + 1) % cells] * t[:, None]
    return np.asarray(rows[:, i] * (1 - t) + rows[:, (i + 1) % cells] * t)


def _speckled(color: tuple[int, int, int], rng: np.random.Generator, fine: float, coarse: float, cells: int = 6) -> Layer:
    wave = coarse * noise(rng, cells) + fine * rng.uniform(-1, 1, (SIZE, SIZE))
    return np.clip(np.asarray(color) * (1 + wave[..., None]), 0, 255).astype(np.uint8)


def _asphalt(rng: np.random.Generator) -> Layer:
    base = _speckled((205, 205, 205), rng, 0.13, 0.10, 5).astype(float)
    patches = noise(rng, 4) + 0.4 * noise(rng, 9)
    base *= np.where(patches > 0.55, 0.86, 1.0)[..., None]
    return base.astype(np.uint8)


def _paving(color: tuple[int, int, int], joint: float, rows: int, columns: int, rng: np.random.Generator) -> Layer:
    """Stones in a running bond, each with its own shade."""
    y, x = np.mgrid[0:SIZE, 0:SIZE] / SIZE
    row = (y * rows).astype(int)
    column = ((x * columns + 0.5 * (row % 2)) % columns).astype(int)
    shade = 1 + 0.10 * rng.uniform(-1, 1, (rows, columns))[row, column] + 0.05 * rng.uniform(-1, 1, (SIZE, SIZE))
    u, v = (x * columns + 0.5 * (row % 2)) % 1, (y * rows) % 1
    edge = np.minimum(np.minimum(u, 1 - u) / columns, np.minimum(v, 1 - v) / rows) * SIZE < 0.9
    return np.clip(np.asarray(color) * (shade * np.where(edge, joint, 1.0))[..., None], 0, 255).astype(np.uint8)


def _leaves(color: tuple[int, int, int], rng: np.random.Generator, cells: int) -> Layer:
    wave = 0.30 * noise(rng, cells) + 0.22 * noise(rng, 2 * cells) + 0.10 * rng.uniform(-1, 1, (SIZE, SIZE))
    return np.clip(np.asarray(color) * (1 + wave[..., None]), 0, 255).astype(np.uint8)


def _flip(picture: Image.Image) -> Layer:
    return np.asarray(picture)[::-1]


_GLASS, _FRAME, _SHADE = (74, 88, 104), (246, 244, 238), (150, 148, 144)
Box = tuple[float, float, float, float]


class _Facade:
    """Draws rectangles in units of the layer: x from the left, y from the ground, both in [0, 1]."""

    def __init__(self, color: tuple[int, int, int], rng: np.random.Generator, fine: float = 0.03) -> None:
        self.picture = Image.fromarray(_speckled(color, rng, fine, 0.04))
        self.draw = ImageDraw.Draw(self.picture)

    def fill(self, box: Box, color: tuple[int, int, int]) -> None:
        x0, y0, x1, y1 = (round(v * SIZE) for v in box)
        self.draw.rectangle((x0, SIZE - y1, x1 - 1, SIZE - y0 - 1), fill=color)

    def window(self, box: Box, bars: int = 1, cross: bool = False, glass: tuple[int, int, int] = _GLASS) -> None:
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


def _grid(f: _Facade, draw: Callable[[float, float], None]) -> Layer:
    """Draws one window for each of two bays by two floors."""
    for x in (0.25, 0.75):
        for y in (0.0, 0.5):
            draw(x, y)
    return _flip(f.picture)


def _sash(rng: np.random.Generator) -> Layer:
    f = _Facade((236, 234, 230), rng)

    def one(x: float, y: float) -> None:
        for side in (-1, 1):
            f.fill((x + side * 0.13 - 0.035, y + 0.11, x + side * 0.13 + 0.035, y + 0.41), (92, 112, 96))
        f.window((x - 0.085, y + 0.12, x + 0.085, y + 0.40))

    return _grid(f, one)


def _pane(rng: np.random.Generator) -> Layer:
    f = _Facade((232, 230, 226), rng)
    layer = _grid(f, lambda x, y: f.window((x - 0.11, y + 0.15, x + 0.11, y + 0.38), 1, True))
    layer = layer.copy()
    layer[: SIZE // 40] = layer[SIZE // 2 : SIZE // 2 + SIZE // 40] = 190
    return layer


def _balcony(rng: np.random.Generator) -> Layer:
    f = _Facade((238, 236, 232), rng)

    def one(x: float, y: float) -> None:
        f.window((x - 0.10, y + 0.06, x + 0.10, y + 0.42), 1)
        f.fill((x - 0.17, y + 0.03, x + 0.17, y + 0.06), (170, 168, 164))
        for i in range(9):
            f.fill((x - 0.16 + i * 0.039, y + 0.06, x - 0.148 + i * 0.039, y + 0.19), (70, 70, 74))
        f.fill((x - 0.17, y + 0.18, x + 0.17, y + 0.20), (60, 60, 64))

    return _grid(f, one)


def _shop(rng: np.random.Generator) -> Layer:
    f = _Facade((196, 190, 182), rng)
    for x, awning in ((0.02, (176, 58, 50)), (0.52, (48, 92, 142))):
        f.window((x + 0.03, 0.16, x + 0.29, 0.72), 2, glass=(62, 70, 78))
        f.fill((x + 0.34, 0.0, x + 0.43, 0.72), (86, 60, 44))
        f.fill((x + 0.355, 0.30, x + 0.415, 0.68), (96, 112, 128))
        f.fill((x, 0.76, x + 0.46, 0.92), awning)
        f.fill((x + 0.10, 0.81, x + 0.36, 0.87), (238, 232, 214))
    return _flip(f.picture)


def _hall(rng: np.random.Generator) -> Layer:
    f = _Facade((214, 210, 204), rng)
    f.fill((0, 0, 1, 0.14), (150, 146, 140))
    for x, door in ((0.0, (112, 62, 44)), (0.5, (52, 78, 66))):
        f.fill((x + 0.055, 0.0, x + 0.205, 0.80), _FRAME)
        f.fill((x + 0.07, 0.0, x + 0.19, 0.76), door)
        f.fill((x + 0.09, 0.50, x + 0.17, 0.70), (104, 118, 132))
        f.window((x + 0.29, 0.30, x + 0.43, 0.78), 1, True)
    f.fill((0, 0.95, 1, 1), (168, 164, 158))
    return _flip(f.picture)


def _glass(rng: np.random.Generator) -> Layer:
    f = _Facade((188, 196, 204), rng)
    for i in range(4):
        for j in range(4):
            shade = int(rng.integers(-16, 17))
            glass = (104 + shade, 134 + shade, 158 + shade) if j % 2 else (82 + shade, 108 + shade, 130 + shade)
            f.fill((i / 4 + 0.012, j / 4 + 0.012, i / 4 + 0.238, j / 4 + 0.238), glass)
    return _flip(f.picture)


def _band(rng: np.random.Generator) -> Layer:
    f = _Facade((226, 226, 224), rng)
    for y in (0.0, 0.5):
        f.fill((0, y + 0.17, 1, y + 0.40), (66, 78, 90))
        f.fill((0, y + 0.32, 1, y + 0.40), (92, 106, 120))
        f.fill((0, y + 0.0, 1, y + 0.02), (168, 168, 168))
        for i in range(6):
            f.fill((i / 6, y + 0.17, i / 6 + 0.018, y + 0.40), (200, 202, 204))
    return _flip(f.picture)


def _loft(rng: np.random.Generator) -> Layer:
    f = _Facade((220, 220, 220), rng)
    bricks = _paving((205, 198, 192), 1.22, 32, 12, rng)
    f.picture.paste(Image.fromarray(bricks))
    for x in (0.25, 0.75):
        for y in (0.0, 0.5):
            f.fill((x - 0.17, y + 0.08, x + 0.17, y + 0.43), (58, 62, 66))
            for i in range(4):
                for j in range(3):
                    u, v = x - 0.16 + i * 0.082, y + 0.095 + j * 0.11
                    f.fill((u, v, u + 0.07, v + 0.095), (110, 124, 134) if (i + j) % 3 else (140, 152, 160))
    return _flip(f.picture)


def _lobby(rng: np.random.Generator) -> Layer:
    f = _Facade((150, 152, 156), rng)
    for i in range(4):
        f.fill((i / 4 + 0.02, 0.04, i / 4 + 0.23, 0.78), (64, 82, 94) if i % 2 else (84, 102, 114))
    f.fill((0.27, 0.0, 0.48, 0.66), (196, 200, 204))
    f.fill((0.285, 0.0, 0.37, 0.64), (50, 62, 72))
    f.fill((0.38, 0.0, 0.465, 0.64), (50, 62, 72))
    f.fill((0, 0.82, 1, 0.94), (214, 214, 212))
    return _flip(f.picture)


def _dock(rng: np.random.Generator) -> Layer:
    f = _Facade((176, 170, 164), rng)
    for x, gate in ((0.04, (196, 160, 60)), (0.54, (118, 128, 136))):
        f.fill((x, 0.0, x + 0.30, 0.80), (70, 72, 74))
        for j in range(7):
            f.fill((x + 0.015, j * 0.11, x + 0.285, j * 0.11 + 0.095), gate)
        f.window((x + 0.345, 0.34, x + 0.42, 0.76), 0)
    return _flip(f.picture)


def _sign(limit: int) -> Layer:
    """A round sign: white, a red ring, the limit in bold digits as wide as the white allows."""
    big = 4 * SIZE
    picture = Image.new("RGB", (big, big), (192, 20, 28))
    draw = ImageDraw.Draw(picture)
    rim = int(0.135 * big)
    draw.ellipse((rim, rim, big - rim, big - rim), fill=(250, 250, 248))
    font = ImageFont.load_default(int(0.56 * big))
    draw.text((big / 2, big * 0.492), str(limit), (12, 12, 14), font, anchor="mm", stroke_width=big // 44, stroke_fill=(12, 12, 14))
    return _flip(picture.resize((SIZE, SIZE), Image.Resampling.BOX))


def _poster(ground: tuple[int, int, int], mark: tuple[int, int, int], word: str) -> Layer:
    picture = Image.new("RGB", (SIZE, SIZE), ground)
    draw = ImageDraw.Draw(picture)
    draw.ellipse((SIZE * 0.3, SIZE * 0.08, SIZE * 0.7, SIZE * 0.48), fill=mark)
    draw.text((SIZE / 2, SIZE * 0.72), word, mark, ImageFont.load_default(SIZE // 4), anchor="mm", stroke_width=1)
    return _flip(picture)


def texture_layers() -> NDArray[np.uint8]:
    """All layers (24, SIZE, SIZE, 3), bottom row first, in the order of `Tex`."""
    rng = np.random.default_rng(20180614)
    plain = np.full((SIZE, SIZE, 3), 255, np.uint8)
    layers = {
        Tex.PLAIN: plain, Tex.ASPHALT: _asphalt(rng),
        Tex.SLABS: _paving((196, 192, 186), 0.72, 4, 4, rng), Tex.BRICKS: _paving((208, 196, 190), 0.74, 12, 6, rng),
        Tex.GRASS: _leaves((112, 138, 74), rng, 8), Tex.GRAVEL: _speckled((176, 162, 136), rng, 0.14, 0.10, 8),
        Tex.LEAVES: _leaves((226, 232, 214), rng, 10), Tex.NEEDLES: _leaves((214, 222, 214), rng, 20),
        Tex.TILES: _paving((214, 206, 202), 0.66, 12, 8, rng),
        Tex.SASH: _sash(rng), Tex.PANE: _pane(rng), Tex.BALCONY: _balcony(rng), Tex.SHOP: _shop(rng), Tex.HALL: _hall(rng),
        Tex.GLASS: _glass(rng), Tex.BAND: _band(rng), Tex.LOFT: _loft(rng), Tex.LOBBY: _lobby(rng), Tex.DOCK: _dock(rng),
        Tex.SIGN_30: _sign(30), Tex.SIGN_60: _sign(60), Tex.SIGN_90: _sign(90),
        Tex.POSTER_A: _poster((222, 176, 58), (60, 44, 40), "JAZZ"), Tex.POSTER_B: _poster((58, 110, 128), (238, 236, 220), "EXPO"),
    }  # fmt: skip
    return np.stack([layers[t] for t in Tex])
