"""Rays, and a lidar with the attributes and the laws of CARLA's (`sensor.lidar.ray_cast`).

Rays are looked up in depth pictures of where they go: each ends where the pixel nearest to it shows something, so that
all ends lie on the surfaces that cameras see, and its angle is off by half a pixel at most.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from caldrive.carla_bridge.axes import Placement, compose
from caldrive.carla_bridge.server.layouts import ActorDescription
from caldrive.world.rendering.pinhole import PinholeCamera

SECTOR = math.radians(60.0)  # that a depth picture covers from side to side
PIXEL = math.radians(0.3)  # in its middle
STEEPEST = 60.0  # degrees, up and down
MOST_RAYS = 1_000_000  # a second
NEAREST = 0.1  # m, for what is divided by a distance
Array = NDArray[np.floating]
Views = Callable[[PinholeCamera], Array]
"""Takes pictures (H, W, K): of distances along the optical axis, m, and of what else there is to know."""


class Rays(NamedTuple):
    """What rays are cast in: the time since the last ones (s), what is there, and chance."""

    delta: float
    views: Views
    rng: np.random.Generator


@dataclass(frozen=True)
class LidarSettings:
    """What a lidar can. Angles in rad, ranges in m."""

    elevations: Array
    """Of its channels, from the highest to the lowest."""
    width: float
    """The angle that it turns through before it begins anew."""
    rate: float
    """Points a second, of all channels."""
    frequency: float
    """Turns a second."""
    range: float
    attenuation: float
    """1/m: the intensity falls by e over its inverse."""
    lost: float
    """Share of points that are lost in any case."""
    bright: float
    """The intensity above which none else is lost."""
    lost_dark: float
    """Share of those with no intensity that are lost else."""
    noise: float
    """m, standard deviation along a ray."""

    def turned(self, delta: float) -> float:
        """The angle (rad) through which it turns in delta seconds."""
        return self.frequency * self.width * delta


def lidar_settings(asked: ActorDescription) -> LidarSettings:
    """From its blueprint. Raises Refusal for what cannot be."""
    rate = asked.number("points_per_second", 56_000, 1, MOST_RAYS)
    channels = int(asked.number("channels", 32, 1, 512))
    highest = asked.number("upper_fov", 10.0, -STEEPEST, STEEPEST)
    lowest = asked.number("lower_fov", -30.0, -STEEPEST, STEEPEST)
    return LidarSettings(
        elevations=np.radians(np.linspace(highest, lowest, channels)), rate=rate,
        width=math.radians(asked.number("horizontal_fov", 360.0, 1.0, 360.0)),
        frequency=asked.number("rotation_frequency", 10.0, 0.01, 1000.0),
        range=asked.number("range", 10.0, 0.1, 1000.0),
        attenuation=asked.number("atmosphere_attenuation_rate", 0.004, 0.0, 100.0),
        lost=asked.number("dropoff_general_rate", 0.45, 0.0, 1.0),
        bright=asked.number("dropoff_intensity_limit", 0.8, 0.0, 1.0),
        lost_dark=asked.number("dropoff_zero_intensity", 0.4, 0.0, 1.0),
        noise=asked.number("noise_stddev", 0.0, 0.0, 100.0),
    )  # fmt: skip


def directions(lidar: LidarSettings, angle: float, delta: float) -> tuple[Array, Array, int]:
    """Of the rays of a lidar that turns on from an angle for delta seconds: to the left and up (N,), rad, channel by
    channel, and how many of each channel."""
    count = round(lidar.rate * delta / len(lidar.elevations))
    turns = np.mod(angle + lidar.turned(delta) * np.arange(count) / max(count, 1), lidar.width)
    return np.tile(lidar.width / 2 - turns, len(lidar.elevations)), np.repeat(lidar.elevations, count), count


@dataclass(frozen=True)
class LidarScan:
    """What a lidar says: for each channel how many points, and x, y, z (m, its own axes, ours) and intensity of all."""

    counts: Array
    points: Array
    """(N, 4), channel by channel."""


def scan(lidar: LidarSettings, place: Placement, angle: float, rays: Rays) -> LidarScan:
    """What a lidar finds while it turns on, to the right, from an angle (rad)."""
    azimuths, elevations, count = directions(lidar, angle, rays.delta)
    ends = cast(place, azimuths, elevations, rays.views)
    distances = np.linalg.norm(ends, axis=1)
    intensity = np.exp(-lidar.attenuation * distances)
    keep = (distances < lidar.range) & (rays.rng.random(len(ends)) >= lidar.lost)
    dark = lidar.lost_dark * (1.0 - intensity / max(lidar.bright, 1e-9))  # at or below 0 where it is bright
    keep &= rays.rng.random(len(ends)) >= dark
    noise = rays.rng.normal(0.0, lidar.noise, len(ends)) / np.maximum(distances, NEAREST)
    points = np.column_stack((ends * (1.0 + noise[:, None]), intensity))[keep]
    return LidarScan(keep.reshape(len(lidar.elevations), count).sum(axis=1), points)


def cast(place: Placement, azimuths: Array, elevations: Array, views: Views) -> Array:
    """Where rays from a place end in its own axes, and what they see: (N, 2 + K) with x ahead, y left, z up, m, beyond
    all ranges in the sky, and the pixels of the other pictures.

    azimuths, elevations: N angles in rad, to the left and up, these at most STEEPEST."""
    found: list[tuple[Array, Array]] = []
    steepest = float(np.abs(np.tan(elevations)).max(initial=0.0)) / math.cos(SECTOR / 2)
    focal = 1 / PIXEL
    size = math.ceil(2 * math.tan(SECTOR / 2) * focal), 2 * math.ceil(steepest * focal) + 2
    sectors = np.round(azimuths / SECTOR).astype(int)
    for k in np.unique(sectors).tolist() or [0]:  # without a ray there is still a picture, and so its layers
        here, turned = sectors == k, k * SECTOR
        view = compose(place, Placement(heading=turned))
        camera = PinholeCamera(
            view.pose, height=view.z, pitch=view.pitch, fov=math.degrees(SECTOR), size=size, roll=view.roll
        )
        c, s = math.cos(turned), math.sin(turned)
        x, y, z, *others = _ends(camera, azimuths[here] - turned, elevations[here], views(camera))
        found.append((here, np.column_stack((c * x - s * y, s * x + c * y, z, *others))))
    ends = np.empty((len(azimuths), found[0][1].shape[1]))
    for here, values in found:
        ends[here] = values
    return ends


def _ends(camera: PinholeCamera, azimuths: Array, elevations: Array, pictures: Array) -> tuple[Array, ...]:
    """Where rays end in the axes of a camera that sees them: ahead, left, up; and the pixels of the other pictures."""
    width, height = camera.size
    columns = width / 2 - np.tan(azimuths) * camera.focal
    rows = height / 2 - np.tan(elevations) / np.cos(azimuths) * camera.focal
    column = np.clip(columns.astype(int), 0, width - 1)
    row = np.clip(rows.astype(int), 0, height - 1)
    ahead, *others = pictures[row, column].astype(float).T
    left, up = (width / 2 - column - 0.5) / camera.focal, (height / 2 - row - 0.5) / camera.focal
    return ahead, ahead * left, ahead * up, *others
