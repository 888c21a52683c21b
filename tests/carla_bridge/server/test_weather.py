"""CARLA's weather and what is drawn of it."""

from __future__ import annotations

import math

import pytest

from caldrive.carla_bridge.server.layouts import Weather
from caldrive.carla_bridge.server.weather import as_carla, drawn
from caldrive.world.scene.weather import WEATHERS


@pytest.mark.parametrize("id", sorted(WEATHERS))
def test_what_a_client_reads_of_a_weather_and_sets_again_is_that_weather(id: int) -> None:
    found = drawn(as_carla(WEATHERS[id]))
    assert found == WEATHERS[id]


def test_fog_that_a_client_adds_is_drawn() -> None:
    assert [drawn(Weather(fog_density=fog)).fog for fog in (0.0, 5.2, 34.0, 100.0, 200.0)] == [
        2.0,
        5.0,
        30.0,
        100.0,
        100.0,
    ]


def test_carlas_own_clear_noon_is_ours() -> None:
    assert drawn(Weather(cloudiness=5.0, sun_altitude=45.0)).name == "ClearNoon"


def test_night_is_drawn_as_sunset_and_small_changes_are_not_drawn() -> None:
    assert drawn(Weather(sun_altitude=-90.0)).sun_altitude == 15.0
    assert drawn(Weather(cloudiness=31.0)) == drawn(Weather(cloudiness=29.0))


def test_numbers_that_are_none_are_drawn_as_nothing() -> None:
    found = drawn(Weather(cloudiness=math.nan, precipitation=1e300, fog_density=math.inf))
    assert (found.cloudiness, found.precipitation) == (0.0, 100.0)
    assert found.fog == 100.0
