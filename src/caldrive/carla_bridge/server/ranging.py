"""Lidar and radar, with the attributes and the laws of CARLA's (`sensor.lidar.ray_cast`, `sensor.other.radar`).

Rays are looked up in depth pictures of where they go: each ends where the pixel nearest to it shows something, so that
all ends lie on the surfaces that cameras see, and its angle is off by half a pixel at most.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from caldrive.carla_bridge.axes import Placement, compose, rotation
from caldrive.carla_bridge.server.layouts import ActorDescription
from caldrive.datatypes import PedestrianState, VehicleState
from caldrive.world.rendering.pinhole import PinholeCamera

SECTOR = math.radians(60.0)  # that a depth picture covers from side to side
PIXEL = math.radians(0.3)  # in its middle
STEEPEST = 60.0  # degrees, up and down
MOST_RAYS = 1_000_000  # a second
NEAR = 0.2  # m around a body within which a point is on it
LOW = 0.1  # m above the ground: what lies lower is the ground
Body = VehicleState | PedestrianState
Array = NDArray[np.floating]
Depths = Callable[[PinholeCamera], Array]
"""Takes a picture (H, W) of distances along the optical axis, m."""


class Rays(NamedTuple):
    """What rays are cast in: the time since the last ones (s), what is there, and chance."""

    delta: float
    depths: Depths
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
        bright=asked.number("dropoff_intensity_limit", 0.8, 0.001, 1.0),
        lost_dark=asked.number("dropoff_zero_intensity", 0.4, 0.0, 1.0),
        noise=asked.number("noise_stddev", 0.0, 0.0, 100.0),
    )  # fmt: skip


@dataclass(frozen=True)
class LidarScan:
    """What a lidar says: for each channel how many points, and x, y, z (m, its own axes, ours) and intensity of all."""

    counts: Array
    points: Array
    """(N, 4), channel by channel."""


def scan(lidar: LidarSettings, place: Placement, angle: float, rays: Rays) -> LidarScan:
    """What a lidar finds while it turns on, to the right, from an angle (rad)."""
    count, turned = round(lidar.rate * rays.delta / len(lidar.elevations)), lidar.turned(rays.delta)
    turns = np.mod(angle + turned * np.arange(count) / max(count, 1), lidar.width)
    azimuths, elevations = np.tile(lidar.width / 2 - turns, len(lidar.elevations)), np.repeat(lidar.elevations, count)
    ends = cast(place, azimuths, elevations, rays.depths)
    distances = np.linalg.norm(ends, axis=1)
    intensity = np.exp(-lidar.attenuation * distances)
    keep = (distances < lidar.range) & (rays.rng.random(len(ends)) >= lidar.lost)
    dark = lidar.lost_dark * (1.0 - intensity / lidar.bright)  # at or below 0 where it is bright
    keep &= rays.rng.random(len(ends)) >= dark
    noise = rays.rng.normal(0.0, lidar.noise, len(ends)) / np.maximum(distances, LOW)
    points = np.column_stack((ends * (1.0 + noise[:, None]), intensity))[keep]
    return LidarScan(keep.reshape(len(lidar.elevations), count).sum(axis=1), points)


@dataclass(frozen=True)
class RadarSettings:
    """What a radar can: its field of view (rad), its reach (m), points a second."""

    width: float
    height: float
    range: float
    rate: float


def radar_settings(asked: ActorDescription) -> RadarSettings:
    """From its blueprint. Raises Refusal for what cannot be."""
    return RadarSettings(
        width=math.radians(asked.number("horizontal_fov", 30.0, 1.0, 2 * STEEPEST)),
        height=math.radians(asked.number("vertical_fov", 30.0, 1.0, 2 * STEEPEST)),
        range=asked.number("range", 100.0, 0.1, 1000.0),
        rate=asked.number("points_per_second", 1500, 1, MOST_RAYS),
    )


def detections(
    radar: RadarSettings, place: Placement, velocity: tuple[float, float], bodies: Iterable[Body], rays: Rays
) -> Array:
    """What a radar finds, (N, 4): how fast it comes nearer (negative) or goes away (m/s), its angles to the left and up
    (rad), and its distance (m). velocity: the radar's own, m/s in the world's axes; bodies: all that may move."""
    count = round(radar.rate * rays.delta)
    share, turn = rays.rng.random(count), rays.rng.random(count) * math.tau
    azimuths, elevations = share * np.cos(turn) * radar.width / 2, share * np.sin(turn) * radar.height / 2
    ends = cast(place, azimuths, elevations, rays.depths)
    distances = np.linalg.norm(ends, axis=1)
    ends, distances = ends[distances < radar.range], distances[distances < radar.range]
    ways = (ends / distances[:, None]) @ rotation(place).T
    points = ways * distances[:, None] + (place.x, place.y, place.z)
    apart = ((velocities(points, bodies) - velocity) * ways[:, :2]).sum(axis=1)
    left, up = np.arctan2(ends[:, 1], ends[:, 0]), np.arcsin(ends[:, 2] / distances)
    return np.column_stack((apart, left, up, distances))


def velocities(points: Array, bodies: Iterable[Body]) -> Array:
    """How fast what lies at points (N, 3) moves, (N, 2) in m/s: as the body that it is on, or not at all."""
    found = np.zeros((len(points), 2))
    for body in bodies:
        if body.speed == 0.0:
            continue
        c, s = math.cos(body.pose.heading), math.sin(body.pose.heading)
        x, y = points[:, 0] - body.pose.x, points[:, 1] - body.pose.y
        length, width = (body.length, body.width) if isinstance(body, VehicleState) else (2 * body.radius,) * 2
        on_it = (np.abs(x * c + y * s) < length / 2 + NEAR) & (np.abs(y * c - x * s) < width / 2 + NEAR)
        found[on_it & (points[:, 2] > LOW)] = body.speed * c, body.speed * s
    return found


def cast(place: Placement, azimuths: Array, elevations: Array, depths: Depths) -> Array:
    """Where rays from a place end, (N, 3) in its own axes: x ahead, y left, z up, m; beyond all ranges in the sky.

    azimuths, elevations: N angles in rad, to the left and up, these at most STEEPEST."""
    ends = np.empty((len(azimuths), 3))
    steepest = float(np.abs(np.tan(elevations)).max(initial=0.0)) / math.cos(SECTOR / 2)
    focal = 1 / PIXEL
    size = math.ceil(2 * math.tan(SECTOR / 2) * focal), 2 * math.ceil(steepest * focal) + 2
    sectors = np.round(azimuths / SECTOR).astype(int)
    for k in np.unique(sectors).tolist():
        here, turned = sectors == k, k * SECTOR
        view = compose(place, Placement(heading=turned))
        camera = PinholeCamera(
            view.pose, height=view.z, pitch=view.pitch, fov=math.degrees(SECTOR), size=size, roll=view.roll
        )
        c, s = math.cos(turned), math.sin(turned)
        x, y, z = _ends(camera, azimuths[here] - turned, elevations[here], depths(camera))
        ends[here] = np.column_stack((c * x - s * y, s * x + c * y, z))
    return ends


def _ends(camera: PinholeCamera, azimuths: Array, elevations: Array, depth: Array) -> tuple[Array, Array, Array]:
    """Where rays end in the axes of a camera that sees them: ahead, left, up."""
    width, height = camera.size
    columns = width / 2 - np.tan(azimuths) * camera.focal
    rows = height / 2 - np.tan(elevations) / np.cos(azimuths) * camera.focal
    column = np.clip(columns.astype(int), 0, width - 1)
    row = np.clip(rows.astype(int), 0, height - 1)
    ahead = depth[row, column].astype(float)
    return ahead, ahead * (width / 2 - column - 0.5) / camera.focal, ahead * (height / 2 - row - 0.5) / camera.focal
