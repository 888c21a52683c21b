"""CARLA's 14 weathers, and the lighting that follows from their figures: pure functions of clouds, rain, puddles, sun.

Colours are display RGB in [0, 1]. All lighting is exposed like a camera's: neither burnt out at noon nor black at
sunset.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Color = NDArray[np.float64]  # (3,)
NOON, SUNSET = 45.0, 15.0  # degrees, the sun's altitude


@dataclass(frozen=True)
class Weather:
    """One of CARLA's weathers. Shares in percent."""

    id: int
    """1 to 14; 0 for one that is none of these."""
    name: str
    """CARLA's name."""
    cloudiness: float
    """Share of the sky."""
    precipitation: float
    """Strength of the rain."""
    puddles: float
    """How much water stands on the road."""
    sun_altitude: float
    """Degrees above the horizon."""
    fog: float
    """Density of the haze."""

    @property
    def sunset(self) -> float:
        """How low the sun stands: 0 at 45 degrees and above, 1 at 15 and below."""
        return float(np.clip((NOON - self.sun_altitude) / (NOON - SUNSET), 0, 1))


_TABLE = (
    Weather(id=1, name="ClearNoon", cloudiness=5, precipitation=0, puddles=0, sun_altitude=NOON, fog=2),
    Weather(id=2, name="CloudyNoon", cloudiness=60, precipitation=0, puddles=0, sun_altitude=NOON, fog=3),
    Weather(id=3, name="WetNoon", cloudiness=5, precipitation=0, puddles=50, sun_altitude=NOON, fog=3),
    Weather(id=4, name="WetCloudyNoon", cloudiness=60, precipitation=0, puddles=50, sun_altitude=NOON, fog=3),
    Weather(id=5, name="MidRainyNoon", cloudiness=60, precipitation=60, puddles=60, sun_altitude=NOON, fog=3),
    Weather(id=6, name="HardRainNoon", cloudiness=100, precipitation=100, puddles=90, sun_altitude=NOON, fog=7),
    Weather(id=7, name="SoftRainNoon", cloudiness=20, precipitation=30, puddles=50, sun_altitude=NOON, fog=3),
    Weather(id=8, name="ClearSunset", cloudiness=5, precipitation=0, puddles=0, sun_altitude=SUNSET, fog=2),
    Weather(id=9, name="CloudySunset", cloudiness=60, precipitation=0, puddles=0, sun_altitude=SUNSET, fog=3),
    Weather(id=10, name="WetSunset", cloudiness=5, precipitation=0, puddles=50, sun_altitude=SUNSET, fog=2),
    Weather(id=11, name="WetCloudySunset", cloudiness=60, precipitation=0, puddles=50, sun_altitude=SUNSET, fog=2),
    Weather(id=12, name="MidRainSunset", cloudiness=60, precipitation=60, puddles=60, sun_altitude=SUNSET, fog=3),
    Weather(id=13, name="HardRainSunset", cloudiness=100, precipitation=100, puddles=90, sun_altitude=SUNSET, fog=7),
    Weather(id=14, name="SoftRainSunset", cloudiness=20, precipitation=30, puddles=50, sun_altitude=SUNSET, fog=2),
)
WEATHERS: dict[int, Weather] = {row.id: row for row in _TABLE}


def weather(id: int) -> Weather:
    """The weather with an id. Raises ValueError for an unknown one."""
    if id not in WEATHERS:
        names = ", ".join(f"{row.id} {row.name}" for row in WEATHERS.values())
        raise ValueError(f"found weather {id}, wanted 1 to 14: {names}")
    return WEATHERS[id]


def as_weather(given: int | Weather) -> Weather:
    """A weather, given itself or by its id. Raises ValueError for an unknown id."""
    return given if isinstance(given, Weather) else weather(given)


@dataclass(frozen=True)
class Lighting:
    """What the shaders need to know of a weather in a town."""

    sun_direction: Color
    """Unit vector towards the sun."""
    sun: Color
    """Its light."""
    sky_ambient: Color
    """Light on faces that look up."""
    ground_ambient: Color
    """Light on faces that look down."""
    zenith: Color
    """Colour of the sky straight up."""
    horizon: Color
    """Colour of the sky at the horizon, and of the fog."""
    fog_density: float
    """1/m, see `fog_density`."""
    wetness: float
    """Of the road, in [0, 1]."""
    puddles: float
    """In [0, 1]."""
    rain: float
    """In [0, 1]."""


def lighting(weather: Weather, azimuth: float) -> Lighting:
    """The lighting of a weather in a town whose sun stands at an azimuth (rad, counter-clockwise from the x axis)."""
    sky, ground = ambient(weather)
    zenith, horizon = sky_colors(weather)
    return Lighting(
        sun_direction=sun_direction(weather.sun_altitude, azimuth),
        sun=sunlight(weather),
        sky_ambient=sky,
        ground_ambient=ground,
        zenith=zenith,
        horizon=horizon,
        fog_density=fog_density(weather),
        wetness=float(np.clip(weather.puddles / 50, 0, 1)),
        puddles=weather.puddles / 100,
        rain=weather.precipitation / 100,
    )


def sun_direction(altitude: float, azimuth: float) -> Color:
    """Unit vector (3,) towards the sun. altitude in degrees, azimuth in rad, counter-clockwise from the x axis."""
    a = math.radians(altitude)
    return np.array([math.cos(a) * math.cos(azimuth), math.cos(a) * math.sin(azimuth), math.sin(a)])


def sunlight(weather: Weather) -> Color:
    """Colour of direct sunlight: warm at sunset, dimmed by clouds."""
    clear = _mix((0.78, 0.74, 0.66), (1.20, 0.78, 0.46), weather.sunset)
    overcast = 0.25 if weather.cloudiness >= 100 else 1.0
    return np.asarray(clear * (1 - weather.cloudiness / 100) ** 0.8 * overcast)


def ambient(weather: Weather) -> tuple[Color, Color]:
    """Light from the sky on faces that look up, and from the ground on faces that look down."""
    clouds = weather.cloudiness / 100
    noon = _mix((0.46, 0.51, 0.60), (0.82, 0.83, 0.85), clouds)
    evening = _mix((0.58, 0.52, 0.57), (0.68, 0.60, 0.58), clouds)
    sky = _mix(noon, evening, weather.sunset) * (1 - 0.10 * weather.precipitation / 100)
    return sky, sky * _mix((0.72, 0.68, 0.62), (0.70, 0.68, 0.66), clouds)


def sky_colors(weather: Weather) -> tuple[Color, Color]:
    """Colours of the sky straight up and at the horizon."""
    clouds = (weather.cloudiness / 100) ** 0.9
    zenith = _mix(
        _mix((0.25, 0.47, 0.82), (0.56, 0.59, 0.63), clouds),
        _mix((0.30, 0.36, 0.58), (0.40, 0.38, 0.42), clouds),
        weather.sunset,
    )
    horizon = _mix(
        _mix((0.74, 0.84, 0.93), (0.76, 0.78, 0.80), clouds),
        _mix((0.98, 0.70, 0.42), (0.72, 0.60, 0.54), clouds),
        weather.sunset,
    )
    dim = 1 - 0.18 * weather.precipitation / 100
    return zenith * dim, horizon * dim


def fog_density(weather: Weather) -> float:
    """Inverse of the distance (1/m) at which haze takes half of the contrast; rain adds to it."""
    return 0.0008 + 0.0011 * weather.fog + 0.002 * weather.precipitation / 100


def _mix(a: tuple[float, ...] | Color, b: tuple[float, ...] | Color, share: float) -> Color:
    """a where the share is 0, b where it is 1."""
    return (1 - share) * np.asarray(a, dtype=float) + share * np.asarray(b, dtype=float)
