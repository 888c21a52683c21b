"""Textures as compiled code reads them: each in levels, of which the next is half as wide."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from caldrive.compiled import Floats, f32, inlined

Texels = NDArray[np.int64]  # a number for each colour, with room between its channels for sums of them
BITS, WIDE = 6, 21  # of a place between two texels, and of a channel
STEPS, CHANNEL = 1 << BITS, (1 << WIDE) - 1
ONE, SCALE = f32(1.0), f32(1 / (255 << 2 * BITS))
SHARPNESS = f32(0.11)  # a level is taken as if a pixel had so many times its area: that is sharp, and flickers little
DEEPEST = 7  # level
Color = tuple[np.float32, np.float32, np.float32]


class Materials(NamedTuple):
    """What the surfaces of a town in one weather are covered with."""

    layers: Texels
    """(layers, M): square textures, see `texels`."""
    panorama: Texels
    """(rows, columns) of the sky, lowest row first: a number for each colour."""
    paint: Floats
    """(4, 4): colours of the centre line, of the edge line and of the asphalt; half widths of centre and edge line,
    inset of the edge line in m, share of a dash."""


def packed(picture: NDArray[np.uint8]) -> Texels:
    """A number for each colour (..., 3)."""
    wide = picture.astype(np.int64)
    return np.ascontiguousarray(wide[..., 0] | wide[..., 1] << WIDE | wide[..., 2] << 2 * WIDE)


def texels(layers: NDArray[np.uint8]) -> Texels:
    """Square pictures (N, SIZE, SIZE, 3) as (N, M): their levels one after the other, a number for each colour."""
    levels = [layers.astype(np.float64)]
    while levels[-1].shape[1] > 1:
        n, size = levels[-1].shape[:2]
        levels.append(levels[-1].reshape(n, size // 2, 2, size // 2, 2, 3).mean(axis=(2, 4)))
    flat = np.concatenate([level.reshape(len(layers), -1, 3) for level in levels], axis=1).round()
    return packed(flat)


@inlined
def level_of(u_right: np.float32, v_right: np.float32, u_down: np.float32, v_down: np.float32, size: int) -> int:
    """The level of a texture of so many texels for what its coordinates change by from pixel to pixel: the next one for
    each four times as many texels."""
    right, down = u_right * u_right + v_right * v_right, u_down * u_down + v_down * v_down
    area = max(right, down) * SHARPNESS * f32(size * size)
    exponent = int(f32(area).view(np.int32) >> 23) - 127  # of two: a logarithm would take as long as all the rest
    return min(max((exponent + 1) >> 1, 0), DEEPEST)


@inlined
def texture(levels: Texels, size: int, level: int, u: np.float32, v: np.float32) -> Color:
    """The colour, in [0, 1], of a texture (M,) of so many texels that repeats; u, v: 0 to 1 across it."""
    whole = size * size
    size >>= level
    first = (whole - size * size) // 3 * 4  # what the levels before take
    x, y, mask = int(u * f32(size * STEPS)) - STEPS // 2, int(v * f32(size * STEPS)) - STEPS // 2, size - 1
    here, beside = (x >> BITS) & mask, ((x >> BITS) + 1) & mask
    low, high = first + ((y >> BITS) & mask) * size, first + (((y >> BITS) + 1) & mask) * size
    a, b, c, d = levels[low + here], levels[low + beside], levels[high + here], levels[high + beside]
    return mixed(a, b, c, d, x & (STEPS - 1), y & (STEPS - 1))


@inlined
def panorama_color(panorama: Texels, u: np.float32, v: np.float32) -> Color:
    """The colour, in [0, 1], of a picture (rows, columns) whose left and right edges meet; u, v: 0 to 1 across it, and
    u up to a picture's width beside it."""
    rows, columns = panorama.shape
    x = int((u + ONE) * f32(columns * STEPS)) - STEPS // 2
    y = min(max(int(v * f32(rows * STEPS)) - STEPS // 2, 0), (rows - 1) * STEPS - 1)
    here, row = x >> BITS, y >> BITS
    here -= columns if here >= columns else 0
    beside = here + 1 if here + 1 < columns else 0
    low, high = panorama[row], panorama[row + 1]
    return mixed(low[here], low[beside], high[here], high[beside], x & (STEPS - 1), y & (STEPS - 1))


@inlined
def mixed(a: int, b: int, c: int, d: int, right: int, up: int) -> Color:
    """The colour, in [0, 1], between four texels, so many of STEPS to the right of a and above it: b lies to the right
    of it, c above it, d above b. All three channels are mixed at once."""
    of_d = right * up
    of_b, of_c = STEPS * right - of_d, STEPS * up - of_d
    color = (STEPS * STEPS - of_b - of_c - of_d) * a + of_b * b + of_c * c + of_d * d
    return f32(color & CHANNEL) * SCALE, f32((color >> WIDE) & CHANNEL) * SCALE, f32(color >> (2 * WIDE)) * SCALE
