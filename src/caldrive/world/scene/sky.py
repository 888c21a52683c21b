"""The sky as a panorama: colours from horizon to zenith, sun, clouds and hills, one picture for each weather."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from caldrive.world.scene.meshes import VERTEX, Mesh
from caldrive.world.scene.patterns import noise
from caldrive.world.scene.weather import Lighting, Weather

COLUMNS, ROWS = 512, 128  # pixels
LOWEST, HIGHEST = -0.08, 1.2  # rad, elevations of the panorama's lower and upper edge
RADIUS = 400.0  # m, of the dome
FAR_OFF = 100.0  # times as far away it lies behind everything
DROPS = 128  # texels of the rain along each side


def panorama(weather: Weather, lighting: Lighting, town_seed: int) -> NDArray[np.uint8]:
    """The sky (ROWS, COLUMNS, 3), lowest row first; columns go counter-clockwise from the x axis. town_seed: for the
    hills at the horizon."""
    azimuth, elevation = _directions()
    up = np.clip(elevation / 0.9, 0, 1) ** 0.6
    sky = lighting.horizon + (lighting.zenith - lighting.horizon) * np.broadcast_to(up, (ROWS, COLUMNS))[..., None]
    sun = lighting.sun_direction
    cos = np.cos(elevation) * (sun[0] * np.cos(azimuth) + sun[1] * np.sin(azimuth)) + np.sin(elevation) * sun[2]
    shine = (1 - weather.cloudiness / 100) ** 0.7
    glow = 0.45 * np.exp((cos - 1) * 14) + 0.5 * np.exp((cos - 1) * 120)
    disc = np.clip((cos - math.cos(0.035)) / 0.0003, 0, 1)
    warm = np.array((1.0, 0.93, 0.80)) * (1 - weather.sunset) + np.array((1.0, 0.72, 0.38)) * weather.sunset
    sky = sky + shine * (glow[..., None] * (warm - 0.25 * sky) * (0.35 + 0.4 * weather.sunset) + disc[..., None])
    cover = _clouds(weather, elevation)[..., None]
    lit = 0.5 + 0.5 * np.clip(cos, 0, 1)[..., None] * shine
    cloud = lighting.horizon * (0.80 + 0.22 * lit) + 0.10 * warm * shine
    dark = 1 - 0.30 * (weather.cloudiness / 100) * np.clip(np.roll(cover, -3, axis=0) * 1.2 - 0.2, 0, 1)
    sky = sky * (1 - 0.92 * cover) + cloud * dark * 0.92 * cover
    return (np.clip(_with_hills(sky, lighting, town_seed), 0, 1) * 255).astype(np.uint8)


def _directions() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Azimuths (1, COLUMNS) and elevations (ROWS, 1) of the pixels, rad."""
    azimuth = (np.arange(COLUMNS) + 0.5) / COLUMNS * math.tau
    elevation = LOWEST + (np.arange(ROWS) + 0.5) / ROWS * (HIGHEST - LOWEST)
    return azimuth[None, :], elevation[:, None]


def _clouds(weather: Weather, elevation: NDArray[np.float64]) -> NDArray[np.float64]:
    """How much cloud covers each direction (ROWS, COLUMNS), 0 to 1: flat layers that close up towards the horizon."""
    rng = np.random.default_rng(1000 + weather.id % 7)  # noon and sunset have the same clouds
    fields = [noise(rng, cells, COLUMNS) for cells in (6, 13, 29, 61)]
    rows = (np.sqrt(np.maximum(elevation[:, 0], 0.0) + 0.02) * 0.75 * COLUMNS).astype(int) % COLUMNS
    field = sum(f[rows] / 1.9**k for k, f in enumerate(fields)) / 1.6
    threshold = 0.62 - 1.35 * weather.cloudiness / 100
    return np.asarray(np.clip((field - threshold) / 0.45, 0, 1) * (0.35 + 0.65 * min(1.0, weather.cloudiness / 50)))


def _with_hills(sky: NDArray[np.float64], lighting: Lighting, town_seed: int) -> NDArray[np.float64]:
    azimuth, elevation = _directions()
    rng = np.random.default_rng(town_seed)
    ridge = np.full_like(azimuth, 0.015)
    for k in (2, 3, 5, 9, 17, 31):
        ridge = ridge + 0.018 / k**0.6 * np.sin(k * azimuth + rng.uniform(0, math.tau)) * rng.uniform(0.4, 1)
    hills = np.clip((np.maximum(ridge, 0.012) - elevation) / 0.01, 0, 1)[..., None]
    color = 0.72 * lighting.horizon + 0.28 * np.array((0.26, 0.34, 0.28)) * float(lighting.sky_ambient.mean() * 1.6)
    return np.asarray(sky * (1 - hills) + color * hills)


def dome_mesh(columns: int = 18) -> Mesh:
    """The panorama's surface seen from inside: bands from the horizon upwards, closed at the top."""
    bands = (LOWEST, 0.3, HIGHEST)
    azimuth = np.arange(columns + 1) / columns * math.tau
    rows = np.zeros((len(bands) + 1, columns + 1), VERTEX)
    for row, elevation in zip(rows, (*bands, math.pi / 2), strict=True):
        flat = RADIUS * math.cos(elevation)
        row["position"] = np.column_stack(
            (flat * np.cos(azimuth), flat * np.sin(azimuth), np.full(columns + 1, RADIUS * math.sin(elevation)))
        )
        row["uv"][:, 0] = azimuth / math.tau
        row["uv"][:, 1] = min((elevation - LOWEST) / (HIGHEST - LOWEST), 1.0)
    column = np.arange(columns, dtype=np.uint32)
    triangles = []
    for k in range(len(bands)):
        low, high = k * (columns + 1) + column, (k + 1) * (columns + 1) + column
        triangles += [np.stack((low, high, low + 1), 1), np.stack((low + 1, high, high + 1), 1)]
    return Mesh(rows.reshape(-1), np.concatenate(triangles).astype(np.uint32))


def dome_triangles() -> NDArray[np.float32]:
    """The dome (T, 3, 5): a direction (3,), u, v for each corner of its triangles, which face the middle."""
    mesh = dome_mesh()
    corners = mesh.vertices[mesh.triangles]
    return np.concatenate((corners["position"] * FAR_OFF, corners["uv"][..., :2]), axis=2).astype(np.float32)


def rain_streaks() -> NDArray[np.uint8]:
    """Streaks of rain (DROPS, DROPS) that repeat at the edges, each two texels wide."""
    rng = np.random.default_rng(7)
    picture = np.zeros((DROPS, DROPS))
    for x, y, length in zip(
        rng.integers(DROPS, size=70), rng.integers(DROPS, size=70), rng.integers(10, 26, 70), strict=True
    ):
        rows = (y + np.arange(length)) % DROPS
        picture[rows, x] = np.maximum(picture[rows, x], np.linspace(0.3, 1.0, length))
        beside = (x + 1) % DROPS
        picture[rows, beside] = np.maximum(picture[rows, beside], np.linspace(0.1, 0.4, length))
    return np.asarray(picture * 255, dtype=np.uint8)
