"""Textures: colours between texels, and the level that fits a pixel."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from caldrive.world.rendering.texturing import DEEPEST, SHARPNESS, level_of, packed, panorama_color, texels, texture
from caldrive.world.scene.patterns import SIZE

PICTURE = np.random.default_rng(0).integers(0, 256, (1, SIZE, SIZE, 3), np.uint8)
LEVELS = texels(PICTURE)[0]
places = st.floats(-3, 3, width=32)


def between(picture: np.ndarray, column: float, row: float) -> np.ndarray:
    """The colour (3,) of a picture that repeats, between the middles of its texels."""
    size = len(picture)
    x, y = column - 0.5, row - 0.5
    x0, y0 = int(np.floor(x)), int(np.floor(y))
    right, up = x - x0, y - y0
    corners = [(y0, x0, (1 - right) * (1 - up)), (y0, x0 + 1, right * (1 - up)), (y0 + 1, x0, (1 - right) * up)]
    corners.append((y0 + 1, x0 + 1, right * up))
    return sum(share * picture[i % size, j % size].astype(float) for i, j, share in corners)


@given(u=places, v=places)
@settings(deadline=None)  # the first example compiles
def test_colours_are_mixed_between_texels_and_repeat(u: float, v: float) -> None:
    wanted = between(PICTURE[0], u * SIZE, v * SIZE) / 255
    assert texture(LEVELS, SIZE, 0, np.float32(u), np.float32(v)) == pytest.approx(wanted, abs=0.04)  # 1/64 texel


@pytest.mark.parametrize("level", range(1, DEEPEST + 1))
def test_each_level_is_the_mean_of_the_one_before(level: int) -> None:
    size = SIZE >> level
    blocks = PICTURE[0].reshape(size, 1 << level, size, 1 << level, 3).mean(axis=(1, 3))
    for row, column in ((0, 0), (size - 1, size // 2)):
        u, v = ((place + 0.5) / size for place in (column, row))
        shown = texture(LEVELS, SIZE, level, np.float32(u), np.float32(v))
        assert shown == pytest.approx(blocks[row, column] / 255, abs=0.01)


@pytest.mark.parametrize("size", [0.0, 1e-3, 0.5, 1.0, 3.0, 40.0, 1e6])
def test_the_level_grows_by_one_where_a_pixel_shows_four_times_as_many_texels(size: float) -> None:
    def at(texels: float) -> int:
        return int(level_of(np.float32(texels / SIZE), np.float32(0), np.float32(0), np.float32(0), SIZE))

    area = SHARPNESS * size**2
    wanted = 0 if area < 2 else min(int(np.log2(area / 2) // 2) + 1, DEEPEST)
    assert at(size) == wanted
    assert at(2 * size) == (min(wanted + 1, DEEPEST) if area >= 2 else at(2 * size))


def test_a_panorama_closes_around_and_ends_above_and_below() -> None:
    picture = np.zeros((4, 8, 3), np.uint8)
    picture[:, 0], picture[:, 7], picture[3] = (255, 0, 0), (0, 255, 0), (0, 0, 255)
    sky = packed(picture)
    red, green, _ = panorama_color(sky, np.float32(0.0), np.float32(0.2))
    assert (red, green) == (pytest.approx(0.5, abs=0.02), pytest.approx(0.5, abs=0.02))
    assert panorama_color(sky, np.float32(0.3), np.float32(9.0)) == pytest.approx((0, 0, 1), abs=0.02)
    assert panorama_color(sky, np.float32(0.3), np.float32(-9.0)) == pytest.approx((0, 0, 0), abs=0.02)
