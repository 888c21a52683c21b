"""Shadows as heights."""

from __future__ import annotations

import numpy as np
import pytest

from caldrive.datatypes import Pose
from caldrive.world.scene import shadows
from caldrive.world.scene.scenery import Prop
from caldrive.world.scene.shadows import (
    RESOLUTION,
    TALLEST_SHADOW,
    cast_shadows,
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


def test_the_picture_of_a_large_town_is_no_larger_than_graphics_take(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(shadows, "MOST_PIXELS", 400)
    house = Prop("building", Pose(0.0, 0.0, 0.0), length=10.0, width=10.0, height=8.0)
    sun = np.array([np.sqrt(0.5), 0.0, np.sqrt(0.5)])
    shade = shadow_heights((house,), (-100.0, -50.0, 100.0, 50.0), sun)[..., 1]  # pixels of half a metre
    assert shade.shape == (200, 400)
    assert shade[100, round((100 - 9) / 0.5)] > 0
    assert shade[100, round((100 + 9) / 0.5)] == 0
