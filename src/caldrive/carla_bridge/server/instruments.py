"""What sensors without a picture say after a step: GNSS, IMU, collisions, and obstacles ahead."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

from caldrive.carla_bridge.axes import Placement, to_carla
from caldrive.carla_bridge.server import wire
from caldrive.carla_bridge.server.actors import Label, description
from caldrive.carla_bridge.server.contacts import prop_box, way_ahead
from caldrive.carla_bridge.server.episode import Episode
from caldrive.carla_bridge.server.layouts import BoundingBox
from caldrive.carla_bridge.server.sensor_actors import Message, SensorActor, reach_of
from caldrive.carla_bridge.server.snapshot import Sensor
from caldrive.carla_bridge.server.vehicles import Vehicle
from caldrive.world.traffic.collisions import obstacle_of

EARTH = 0.9996 * 6_378_137.0  # m, the radius by which CARLA's client turns places into degrees (it scales by UTM's)


def geo_location(place: Placement) -> tuple[float, float, float]:
    """Latitude, longitude (degrees) and height (m) of a place, as CARLA's client reckons them."""
    x, y, z, *_ = to_carla(place)
    return math.degrees(y / EARTH), math.degrees(x / EARTH), z


def gnss(sensor: SensorActor, episode: Episode) -> Iterator[tuple[Sensor, Message]]:
    """Where the sensor is: latitude, longitude (degrees) and height (m)."""
    yield Sensor.GNSS, [wire.encode(geo_location(sensor.place))]


def imu(sensor: SensorActor, episode: Episode) -> Iterator[tuple[Sensor, Message]]:
    """Acceleration (m/s²) in the sensor's axes, turning (rad/s) and compass (rad)."""
    place = sensor.place
    _, turning, acceleration = sensor.parent.motion if sensor.parent else sensor.motion
    _, _, _, _, yaw, _ = to_carla(place)
    c, s = math.cos(math.radians(yaw)), math.sin(math.radians(yaw))
    ahead, right = c * acceleration[0] + s * acceleration[1], c * acceleration[1] - s * acceleration[0]
    gyro = tuple(math.radians(rate) for rate in turning)
    compass = math.radians((yaw + 90.0) % 360.0)
    yield Sensor.IMU, [wire.encode(((ahead, right, acceleration[2] + episode.gravity), gyro, compass))]


def collisions(sensor: SensorActor, episode: Episode) -> Iterator[tuple[Sensor, Message]]:
    """A message for each contact of its carrier, with the impulse on it (N s, CARLA's axes): a vehicle's own ones, and
    those of the vehicles that run into somebody on foot or into a car of SUMO's."""
    own = sensor.parent
    for vehicle, contact, (x, y) in episode.hits:
        if vehicle is own:
            yield Sensor.COLLISION, [wire.encode((own.layout(b""), _other(contact.id, episode), (x, -y, 0.0)))]
        elif own and not isinstance(own, Vehicle) and episode.actor_of(contact.id) is own:
            yield Sensor.COLLISION, [wire.encode((own.layout(b""), vehicle.layout(b""), (-x, y, 0.0)))]


def _other(name: str, episode: Episode) -> Any:
    """The actor behind a name, or one that stands for a thing of the town."""
    actor = episode.actor_of(name)
    if actor is not None:
        return actor.layout(b"")
    return 0, 0, description(f"static.{name.rstrip('0123456789')}"), BoundingBox(), bytes([Label.STATIC]), b""


def obstacle(sensor: SensorActor, episode: Episode) -> Iterator[tuple[Sensor, Message]]:
    """The nearest thing ahead, where there is one."""
    asked, place = sensor.description, sensor.place
    reach, radius = reach_of(asked)
    own = sensor.parent.id if sensor.parent else 0
    scene = episode.scene(place, None)
    bodies: Sequence[Any] = (*scene.vehicles, *scene.pedestrians)
    near = [obstacle_of(one) for one in bodies if (actor := episode.actor_of(one.id)) and actor.id != own]
    if asked.get("only_dynamics", "false").lower() != "true":
        near += [*episode.town.obstacles.near(place.pose, reach + radius), *map(prop_box, episode.props())]
    found = way_ahead(place.pose, reach, radius, near)
    if found is not None:
        mine = (sensor.parent or sensor).layout(b"")
        yield Sensor.OBSTACLE, [wire.encode((mine, _other(found[0].id, episode), found[1]))]
