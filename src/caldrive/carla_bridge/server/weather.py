"""CARLA's weather and what the embedded world draws of it.

Drawn: clouds, rain, water on the road, haze, and a sun between 15 and 45 degrees whose azimuth is the town's. Not
drawn: night, wind, dust, and where fog begins. Clients read back what they set.
"""

from __future__ import annotations

from caldrive.carla_bridge.server.layouts import Weather as CarlaWeather
from caldrive.world.scene.weather import NOON, SUNSET, WEATHERS, Weather

STEP = 10.0  # percent, and degrees / 2: what is drawn changes in such steps, as every sky has to be painted
THINNEST, THICKEST = 2.0, 100.0  # percent of fog that is drawn; CARLA's own weathers have 2 to 7
WET = 0.5  # of the standing water that makes a road as wet


def drawn(wanted: CarlaWeather) -> Weather:
    """The weather that is drawn for one that a client asks for; exactly one of CARLA's where it is one of them."""
    puddles = max(wanted.precipitation_deposits, WET * wanted.wetness)
    clouds, rain, water = map(_share, (wanted.cloudiness, wanted.precipitation, puddles))
    sun = min(max(_stepped(wanted.sun_altitude, STEP / 2), SUNSET), NOON)
    fog = min(max(_stepped(wanted.fog_density, 1.0 if wanted.fog_density < STEP else STEP), THINNEST), THICKEST)
    found = Weather(0, "of a client", cloudiness=clouds, precipitation=rain, puddles=water, sun_altitude=sun, fog=fog)
    return next((known for known in WEATHERS.values() if _numbers(known) == _numbers(found)), found)


def _numbers(weather: Weather) -> tuple[float, ...]:
    """In the steps in which weathers are told apart."""
    shares = map(_share, (weather.cloudiness, weather.precipitation, weather.puddles))
    return *shares, weather.sun_altitude, weather.fog


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
