"""A radar with the attributes and the laws of CARLA's (`sensor.other.radar`)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from caldrive.carla_bridge.axes import Placement, rotation
from caldrive.carla_bridge.server.instances import Body, owners
from caldrive.carla_bridge.server.layouts import ActorDescription
from caldrive.carla_bridge.server.lidar import MOST_RAYS, STEEPEST, Array, Rays, cast


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
    radar: RadarSettings, place: Placement, velocity: tuple[float, float], bodies: Sequence[Body], rays: Rays
) -> Array:
    """What a radar finds, (N, 4): how fast it comes nearer (negative) or goes away (m/s), its angles to the left and up
    (rad), and its distance (m). velocity: the radar's own, m/s in the world's axes; bodies: all that may move."""
    count = round(radar.rate * rays.delta)
    share, turn = rays.rng.random(count), rays.rng.random(count) * math.tau
    azimuths, elevations = share * np.cos(turn) * radar.width / 2, share * np.sin(turn) * radar.height / 2
    ends = cast(place, azimuths, elevations, rays.views)
    distances = np.linalg.norm(ends, axis=1)
    ends, distances = ends[distances < radar.range], distances[distances < radar.range]
    ways = (ends / distances[:, None]) @ rotation(place).T
    points = ways * distances[:, None] + (place.x, place.y, place.z)
    apart = ((velocities(points, bodies) - velocity) * ways[:, :2]).sum(axis=1)
    left, up = np.arctan2(ends[:, 1], ends[:, 0]), np.arcsin(ends[:, 2] / distances)
    return np.column_stack((apart, left, up, distances))


def velocities(points: Array, bodies: Sequence[Body]) -> Array:
    """How fast what lies at points (N, 3) moves, (N, 2) in m/s: as the body that it is on, or not at all."""
    ways = [(math.cos(body.pose.heading), math.sin(body.pose.heading)) for body in bodies]
    moving = np.array([*(body.speed * np.array(way) for body, way in zip(bodies, ways, strict=True)), (0.0, 0.0)])
    found: Array = moving[owners(points, bodies)]  # the last one for none
    return found
