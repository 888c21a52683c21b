"""The binary messages of streams: the header of every one, and the snapshot of the world."""

from __future__ import annotations

import struct
from enum import IntEnum

from caldrive.carla_bridge.axes import Placement, to_carla
from caldrive.carla_bridge.server.layouts import VehicleControl, WalkerControl

HEADER = struct.Struct("<QQd6f")
WORLD_HEAD = struct.Struct("<QdfiiiI")
ACTOR = struct.Struct("<IB15f54s")
VEHICLE = struct.Struct("<3f3Bif2BIB")
WALKER = struct.Struct("<4fB")
LIGHT = struct.Struct("<32s4fI2B")
ACTIVE = 1  # the state of an actor
Triple = tuple[float, float, float]
NOTHING: Triple = (0.0, 0.0, 0.0)


class Sensor(IntEnum):
    """The number of each kind of message in CARLA 0.9.16."""

    COLLISION = 0
    DEPTH = 1
    GNSS = 4
    IMU = 5
    OBSTACLE = 7
    RADAR = 9
    SEMANTIC_LIDAR = 10
    LIDAR = 11
    RGB = 13
    SEMANTIC = 14
    INSTANCE = 15
    WORLD = 17


def header(sensor: Sensor, frame: int, time: float, place: Placement | None = None) -> bytes:
    """What every message begins with; time in s, place: the sensor's."""
    return HEADER.pack(sensor, frame, time, *(to_carla(place) if place else (0.0,) * 6))


def world_head(episode: int, time: float, delta: float) -> bytes:
    """What a snapshot begins with, before its actors; time and delta in s.

    No flag says that the map has changed: the episode's number does. On the flag a client asks for street lamps from
    within the thread that reads snapshots, and it crashes if it leaves the episode meanwhile."""
    return WORLD_HEAD.pack(episode, time, delta, 0, 0, 0, 0)


def actor_row(id: int, place: Placement, motion: tuple[Triple, Triple, Triple], rest: bytes = b"") -> bytes:
    """An actor. motion: velocity (m/s), angular velocity (degrees/s), acceleration (m/s²), in CARLA's axes; rest: what
    its kind adds."""
    velocity, turning, acceleration = motion
    return ACTOR.pack(id, ACTIVE, *to_carla(place), *velocity, *turning, *acceleration, rest)


def vehicle_part(control: VehicleControl, limit: float, light: tuple[int, int] | None) -> bytes:
    """What a vehicle adds. limit: in km/h; light: the traffic light it is at, its state and id."""
    state, id = light or (0, 0)
    return VEHICLE.pack(
        control.throttle, control.steer, control.brake, control.hand_brake, control.reverse,
        control.manual_gear_shift, control.gear, limit, state, light is not None, id, 0,
    )  # fmt: skip


def walker_part(control: WalkerControl) -> bytes:
    """What a walker adds."""
    direction = control.direction
    return WALKER.pack(direction.x, direction.y, direction.z, control.speed, control.jump)


def sign_part(sign: str) -> bytes:
    """What a sign adds: its id on the map."""
    return sign.encode()[:31]


def light_part(sign: str, times: Triple, elapsed: float, pole: int, is_frozen: bool, state: int) -> bytes:
    """What a traffic light adds: its id on the map, s of green, yellow and red, s since it changed, its number among
    those of its junction, and what it shows."""
    return LIGHT.pack(sign_part(sign), *times, elapsed, pole, is_frozen, state)
