"""The 14 weathers, and the looks that follow from their figures: pure functions of cloudiness, rain, puddles and sun.

Colours are display RGB in [0, 1]. All looks are exposed like a camera's: neither burnt out at noon nor black at sunset.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Color = NDArray[np.float64]  # (3,)


@dataclass(frozen=True)
class Weather:
    """Cloudiness, precipitation, puddles and fog in percent, the sun's altitude in degrees."""

    id: int
    name: str
    cloudiness: float
    precipitation: float
    puddles: float
    sun_altitude: float
    fog: float

    @property
    def sunset(self) -> float:
        """How low the sun stands: 0 at 45 degrees and above, 1 at 15 and below."""
        return float(np.clip((45 - self.sun_altitude) / 30, 0, 1))


_TABLE = (
    (1, "ClearNoon", 5, 0, 0, 45, 2),
    (2, "CloudyNoon", 60, 0, 0, 45, 3),
    (3, "WetNoon", 5, 0, 50, 45, 3),
    (4, "WetCloudyNoon", 60, 0, 50, 45, 3),
    (5, "MidRainyNoon", 60, 60, 60, 45, 3),
    (6, "HardRainNoon", 100, 100, 90, 45, 7),
    (7, "SoftRainNoon", 20, 30, 50, 45, 3),
    (8, "ClearSunset", 5, 0, 0, 15, 2),
    (9, "CloudySunset", 60, 0, 0, 15, 3),
    (10, "WetSunset", 5, 0, 50, 15, 2),
    (11, "WetCloudySunset", 60, 0, 50, 15, 2),
    (12, "MidRainSunset", 60, 60, 60, 15, 3),
    (13, "HardRainSunset", 100, 100, 90, 15, 7),
    (14, "SoftRainSunset", 20, 30, 50, 15, 2),
)

WEATHERS: dict[int, Weather] = {row[0]: Weather(*row) for row in _TABLE}


def weather(id: int) -> Weather:
    """The weather with an id. Raises ValueError for an unknown one."""
    if id not in WEATHERS:
        names = ", ".join(f"{w.id} {w.name}" for w in WEATHERS.values())
        raise ValueError(f"found weather {id}, wanted 1 to 14: {names}")
    return WEATHERS[id]


def _mix(a: tuple[float, ...] | Color, b: tuple[float, ...] | Color, share: float) -> Color:
    return (1 - share) * np.asarray(a, dtype=float) + share * np.asarray(b, dtype=float)


@dataclass(frozen=True)
class Look:
    """What the shaders need to know of a weather. sun_direction: towards the sun. fog_density: per metre."""

    sun_direction: Color
    sun: Color
    sky_ambient: Color
    ground_ambient: Color
    zenith: Color
    horizon: Color
    fog_density: float
    wetness: float
    puddles: float
    rain: float


def sun_direction(altitude: float, azimuth: float) -> Color:
    """Unit vector towards the sun. altitude in degrees, azimuth in rad, counter-clockwise from the x axis."""
    a = math.radians(altitude)
    return np.array([math.cos(a) * math.cos(azimuth), math.cos(a) * math.sin(azimuth), math.sin(a)])


def sunlight(w: Weather) -> Color:
    """Colour of direct sunlight: warm at sunset, dimmed by clouds."""
    clear = _mix((0.78, 0.74, 0.66), (1.20, 0.78, 0.46), w.sunset)
    return np.asarray(clear * (1 - w.cloudiness / 100) ** 0.8 * (0.25 if w.cloudiness >= 100 else 1.0))


def ambient(w: Weather) -> tuple[Color, Color]:
    """Light from the sky on faces that look up, and from the ground on faces that look down."""
    clouds = w.cloudiness / 100
    noon = _mix((0.46, 0.51, 0.60), (0.82, 0.83, 0.85), clouds)
    evening = _mix((0.58, 0.52, 0.57), (0.68, 0.60, 0.58), clouds)
    sky = _mix(noon, evening, w.sunset) * (1 - 0.10 * w.precipitation / 100)
    return sky, sky * _mix((0.72, 0.68, 0.62), (0.70, 0.68, 0.66), clouds)


def sky_colors(w: Weather) -> tuple[Color, Color]:
    """Colours of the sky straight up and at the horizon."""
    clouds = (w.cloudiness / 100) ** 0.9
    zenith = _mix(
        _mix((0.25, 0.47, 0.82), (0.56, 0.59, 0.63), clouds),
        _mix((0.30, 0.36, 0.58), (0.40, 0.38, 0.42), clouds),
        w.sunset,
    )
    horizon = _mix(
        _mix((0.74, 0.84, 0.93), (0.76, 0.78, 0.80), clouds),
        _mix((0.98, 0.70, 0.42), (0.72, 0.60, 0.54), clouds),
        w.sunset,
    )
    dim = 1 - 0.18 * w.precipitation / 100
    return zenith * dim, horizon * dim


def fog_density(w: Weather) -> float:
    """Inverse of the distance (1/m) at which haze takes half of the contrast; rain adds to it."""
    return 0.0008 + 0.0011 * w.fog + 0.002 * w.precipitation / 100


def look(w: Weather, azimuth: float) -> Look:
    """The look of a weather in a town whose sun stands at an azimuth (rad)."""
    sky, ground = ambient(w)
    zenith, horizon = sky_colors(w)
    return Look(
        sun_direction(w.sun_altitude, azimuth), sunlight(w), sky, ground, zenith, horizon, fog_density(w),
        wetness=float(np.clip(w.puddles / 50, 0, 1)), puddles=w.puddles / 100, rain=w.precipitation / 100,
    )  # fmt: skip
