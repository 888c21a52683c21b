"""Sensors as actors: where they are, and what their blueprints' attributes ask of them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from caldrive.carla_bridge.server.actors import Actor
from caldrive.carla_bridge.server.layouts import ActorDescription
from caldrive.carla_bridge.server.lidar import lidar_settings
from caldrive.carla_bridge.server.radar import radar_settings
from caldrive.carla_bridge.server.wire import Refusal
from caldrive.checks import MOST_PIXELS

MOST_AREA = 2**22  # pixels of an image
Message = list[Any]  # pieces of bytes


@dataclass(eq=False)
class SensorActor(Actor):
    """A sensor."""

    every: float = 0.0
    """s between two messages; 0 for one in each step."""
    due: float = -math.inf
    """s of the next; long ago for who has said nothing yet."""
    size: tuple[int, int] = (0, 0)
    """Of an image, pixels."""
    fov: float = 90.0
    """Degrees."""
    angle: float = 0.0
    """Of a lidar's turn, rad."""
    is_silent: bool = False
    """Whether a fault has ended what it says."""


def checked(sensor: SensorActor) -> SensorActor:
    """A sensor with its attributes read. Raises Refusal where they cannot be."""
    asked = sensor.description
    sensor.every = asked.number("sensor_tick", 0.0, 0.0, 1e6)
    if ".camera." in sensor.kind:
        width, height = (int(asked.number(f"image_size_{axis}", 800, 1, MOST_PIXELS)) for axis in "xy")
        if width * height > MOST_AREA:
            raise Refusal(f"found an image of {width} x {height}, wanted {MOST_AREA} pixels at most: ask for fewer")
        sensor.size, sensor.fov = (width, height), asked.number("fov", 90.0, 1.0, 170.0)
    if sensor.kind.startswith("sensor.lidar."):
        lidar_settings(asked)
    if sensor.kind == "sensor.other.radar":
        radar_settings(asked)
    if sensor.kind == "sensor.other.obstacle":
        reach_of(asked)
    return sensor


def reach_of(asked: ActorDescription) -> tuple[float, float]:
    """How far an obstacle sensor looks, and how far aside (m). Raises Refusal."""
    return asked.number("distance", 5.0, 0.1, 500.0), asked.number("hit_radius", 0.5, 0.01, 50.0)
