"""The 14 weathers and the lighting that follows from them."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from caldrive.world.scene.weather import WEATHERS, fog_density, lighting, sun_direction, sunlight, weather

IDS = st.sampled_from(sorted(WEATHERS))


def test_there_are_fourteen_and_the_second_half_is_at_sunset() -> None:
    assert sorted(WEATHERS) == list(range(1, 15))
    assert [weather(i).sunset for i in range(1, 15)] == [0.0] * 7 + [1.0] * 7


def test_an_unknown_weather_is_refused_in_one_sentence() -> None:
    with pytest.raises(ValueError, match=r"found weather 15, wanted 1 to 14: 1 ClearNoon"):
        weather(15)


@given(IDS, st.floats(0, 6.28))
def test_all_lighting_can_be_shown(id: int, azimuth: float) -> None:
    light = lighting(weather(id), azimuth)
    assert np.isclose(np.linalg.norm(light.sun_direction), 1)
    for color in (light.sky_ambient, light.ground_ambient, light.zenith, light.horizon):
        assert np.all((color > 0.1) & (color <= 1.0))
    assert np.all(light.sun >= 0)


def test_the_sun_stands_where_it_is_told_to() -> None:
    x, y, z = sun_direction(30.0, np.pi / 2)
    assert (x, y, z) == pytest.approx((0.0, np.cos(np.pi / 6), 0.5))


def test_clouds_dim_the_sun_and_sunset_reddens_it() -> None:
    clear, cloudy, evening = (sunlight(weather(i)) for i in (1, 2, 8))
    assert cloudy.sum() < clear.sum()
    assert evening[0] / evening[2] > 1.5 * clear[0] / clear[2]


def test_hard_rain_hides_more_than_a_clear_day() -> None:
    assert fog_density(weather(6)) > 2 * fog_density(weather(1))


def test_no_two_weathers_look_alike() -> None:
    all_lighting = [lighting(weather(id), 1.0) for id in WEATHERS]
    rows = np.array(
        [(*k.sun, *k.sky_ambient, *k.horizon, k.wetness, k.puddles, k.rain, 50 * k.fog_density) for k in all_lighting]
    )
    gaps = np.abs(rows[:, None] - rows[None]).max(axis=2) + np.eye(len(rows))
    assert gaps.min() > 0.05
