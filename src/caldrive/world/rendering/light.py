"""The light that fragments are shaded with: sun and sky, shadows and haze."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from caldrive.compiled import Floats, Integers, f32, inlined
from caldrive.world.rendering.texturing import BITS, STEPS
from caldrive.world.scene.shadows import TALLEST_SHADOW, Bounds
from caldrive.world.scene.weather import Lighting

ZERO, ONE = f32(0.0), f32(1.0)
TWO_BYTES = 0xFF00FF
METRES = f32(TALLEST_SHADOW / 255 / STEPS**2)


class Light(NamedTuple):
    """What holds for all pictures of a town in one weather."""

    sun_direction: Floats
    """(3,) to the sun."""
    sun: Floats
    """(3,), as all colours here, in [0, 1]."""
    sky_ambient: Floats
    ground_ambient: Floats
    horizon: Floats
    zenith: Floats
    fog: np.float32
    """1/m."""
    wetness: np.float32
    puddles: np.float32
    rain: np.float32
    shadows: Integers
    """(rows, columns): four bytes each, of a texel and of the next one to the right, each with trees and without."""
    area: Floats
    """(4,): x and y of the middle of the first texel in m, steps between texels in a metre along x and y."""


def packed_shadows(heights: NDArray[np.uint8]) -> Integers:
    """`Light.shadows` from heights (rows, columns, 2), as `scene.shadows` has them."""
    here = heights.astype(np.int32)
    beside = np.roll(here, -1, axis=1)
    return np.ascontiguousarray(here[..., 0] | here[..., 1] << 8 | beside[..., 0] << 16 | beside[..., 1] << 24)


def light_of(lighting: Lighting, shadows: Integers, bounds: Bounds) -> Light:
    """The light of a weather. shadows: as in `Light`; bounds: what they cover, m."""
    (x0, y0, x1, y1), (rows, columns) = bounds, shadows.shape
    dx, dy = (x1 - x0) / columns, (y1 - y0) / rows
    return Light(
        sun_direction=lighting.sun_direction.astype(np.float32),
        sun=lighting.sun.astype(np.float32),
        sky_ambient=lighting.sky_ambient.astype(np.float32),
        ground_ambient=lighting.ground_ambient.astype(np.float32),
        horizon=lighting.horizon.astype(np.float32),
        zenith=lighting.zenith.astype(np.float32),
        fog=f32(lighting.fog_density),
        wetness=f32(lighting.wetness),
        puddles=f32(lighting.puddles),
        rain=f32(lighting.rain),
        shadows=shadows,
        area=np.array((x0 + dx / 2, y0 + dy / 2, STEPS / dx, STEPS / dy), np.float32),
    )


@inlined
def sunshine(light: Light, x: np.float32, y: np.float32, z: np.float32, without_trees: int) -> np.float32:
    """1 in the sun, 0 in the shade, at a place in m."""
    rows, columns = light.shadows.shape
    right, up = int((x - light.area[0]) * light.area[2]), int((y - light.area[1]) * light.area[3])
    right, up = min(max(right, 0), (columns - 1) * STEPS - 1), min(max(up, 0), (rows - 1) * STEPS - 1)
    column, row, shift = right >> BITS, up >> BITS, 8 * without_trees
    right, up = right & (STEPS - 1), up & (STEPS - 1)
    low, high = light.shadows[row, column] >> shift, light.shadows[row + 1, column] >> shift
    both = (low & TWO_BYTES) * (STEPS - up) + (high & TWO_BYTES) * up  # here, and to the right
    height = f32((both & 0xFFFF) * (STEPS - right) + (both >> 16) * right)
    return min(max((z - height * METRES) * f32(2.0) + ONE, ZERO), ONE)


@inlined
def clarity(light: Light, w: np.float32) -> np.float32:
    """How much of a colour comes through the haze from so many metres ahead; the rest is the horizon's."""
    depth = light.fog * w
    return ONE / (ONE + depth * depth)
