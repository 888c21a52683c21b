"""CARLA's weather and what the embedded world draws of it.

Drawn: clouds, rain, water on the road, haze, and a sun between 15 and 45 degrees whose azimuth is the town's. Not
drawn: night, wind, dust, and where fog begins. Clients read back what they set.
"""

from __future__ import annotations

from caldrive.carla_bridge.server.layouts import Weather as CarlaWeather
from caldrive.world.scene.weather import NOON, SUNSET, WEATHERS, Weather

STEP = 10.0  # percent, and degrees / 2: what is drawn changes in such steps, as every sky has to be painted
THICKEST = 10.0  # of the haze, which CARLA counts to 100
WET = 0.5  # of the standing water that makes a road as wet


def drawn(wanted: CarlaWeather) -> Weather:
    """The weather that is drawn for one that a client asks for; exactly one of CARLA's where it is one of them."""
    puddles = max(wanted.precipitation_deposits, WET * wanted.wetness)
    numbers = (
        _share(wanted.cloudiness), _share(wanted.precipitation), _share(puddles),
        min(max(_stepped(wanted.sun_altitude, STEP / 2), SUNSET), NOON),
    )  # fmt: skip
    for known in WEATHERS.values():
        if numbers == (
            _share(known.cloudiness),
            _share(known.precipitation),
            _share(known.puddles),
            known.sun_altitude,
        ):
            return known
    fog = min(max(_stepped(wanted.fog_density / 10, 1.0), 2.0), THICKEST)
    clouds, rain, water, sun = numbers
    return Weather(
        id=0, name="of a client", cloudiness=clouds, precipitation=rain, puddles=water, sun_altitude=sun, fog=fog
    )


def as_carla(weather: Weather) -> CarlaWeather:
    """One of the embedded world's weathers as a client reads it."""
    return CarlaWeather(
        cloudiness=weather.cloudiness, precipitation=weather.precipitation, precipitation_deposits=weather.puddles,
        sun_altitude=weather.sun_altitude, fog_density=weather.fog,
    )  # fmt: skip


def _share(percent: float) -> float:
    return min(max(_stepped(percent, STEP), 0.0), 100.0)


def _stepped(value: float, step: float) -> float:
    """The nearest step. No number is none of any."""
    return step * round(min(max(value, -1e6), 1e6) / step) if value == value else 0.0
