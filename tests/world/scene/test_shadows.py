"""Shadows as heights."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from caldrive.datatypes import Pose
from caldrive.world.scene.scenery import Prop
from caldrive.world.scene.shadows import (
    LARGEST,
    RESOLUTION,
    TALLEST_SHADOW,
    cast_shadows,
    shadow_bounds,
    shadow_heights,
)


def test_a_wall_throws_its_shadow_away_from_the_sun() -> None:
    heights = np.zeros((200, 200), np.uint8)
    heights[100, :] = round(4.0 / TALLEST_SHADOW * 255)
    shade = cast_shadows(heights, np.array([0.0, np.sqrt(0.5), np.sqrt(0.5)]))  # the sun stands at 45 degrees over +y
    reach = round(4.0 / RESOLUTION)
    assert (shade[100 - reach + 2 : 100, 50] > 0).all()
    assert not shade[: 100 - reach - 1, 50].any()
    assert not shade[101:, 50].any()
    assert shade[100 - reach // 2, 50] * TALLEST_SHADOW / 255 == pytest.approx(2.0, abs=0.3)


def test_a_house_shades_what_lies_behind_it() -> None:
    house = Prop("building", Pose(0.0, 0.0, 0.0), length=10.0, width=10.0, height=8.0)
    sun = np.array([np.sqrt(0.5), 0.0, np.sqrt(0.5)])
    shade = shadow_heights((house,), (-40.0, -40.0, 40.0, 40.0), sun)[..., 1]
    row = shade[shade.shape[0] // 2]
    assert row[round((40 - 9) / RESOLUTION)] > 0  # 4 m behind the wall that looks away from the sun
    assert row[round((40 + 9) / RESOLUTION)] == 0


@given(st.floats(-2e4, 2e4), st.floats(-2e4, 2e4))
def test_of_a_large_town_the_part_around_a_place_is_drawn(x: float, y: float) -> None:
    x0, y0, x1, y1 = shadow_bounds((-2e4, -2e4, 2e4, 2e4), x, y)
    assert (x1 - x0, y1 - y0) == (LARGEST, LARGEST)
    assert min(x - x0, x1 - x, y - y0, y1 - y) >= LARGEST / 4, "as far as one can see"


def test_a_small_town_is_drawn_whole_wherever_one_stands() -> None:
    assert {shadow_bounds((0.0, 0.0, 400.0, 300.0), x, x) for x in (0.0, 390.0, 900.0)} == {(-30, -30, 430, 330)}
