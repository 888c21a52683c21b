"""The sensors that clients spawn, and what each of them says after a step."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from caldrive.carla_bridge.axes import Placement, to_carla
from caldrive.carla_bridge.server import wire
from caldrive.carla_bridge.server.actors import Actor, Label, Prop, description
from caldrive.carla_bridge.server.contacts import prop_box, way_ahead
from caldrive.carla_bridge.server.episode import Episode
from caldrive.carla_bridge.server.layouts import ActorDescription, BoundingBox
from caldrive.carla_bridge.server.ranging import Rays, detections, lidar_settings, radar_settings, scan
from caldrive.carla_bridge.server.snapshot import Sensor, header
from caldrive.carla_bridge.server.wire import Refusal
from caldrive.checks import MOST_PIXELS
from caldrive.datatypes import Semantic
from caldrive.world.rendering.camera import CameraRig
from caldrive.world.rendering.pinhole import PinholeCamera
from caldrive.world.town import Town
from caldrive.world.traffic.collisions import obstacle_of

EARTH = 0.9996 * 6_378_137.0  # m, the radius by which CARLA's client turns places into degrees (it scales by UTM's)
GRAVITY = 9.81  # m/s²
FARTHEST = 1000.0  # m that a depth image reaches
DEPTH_STEPS = 256**3 - 1
MOST_AREA = 2**22  # pixels of an image
LABELS = {
    Semantic.SKY: Label.SKY, Semantic.ROAD: Label.ROAD, Semantic.LINE: Label.LINE, Semantic.SIDEWALK: Label.SIDEWALK,
    Semantic.GROUND: Label.TERRAIN, Semantic.BUILDING: Label.BUILDING, Semantic.PLANT: Label.VEGETATION,
    Semantic.FURNITURE: Label.STATIC, Semantic.LIGHT: Label.LIGHT, Semantic.SIGN: Label.SIGN,
    Semantic.VEHICLE: Label.CAR, Semantic.PERSON: Label.PEDESTRIAN,
}  # fmt: skip
_LABELS = np.array([LABELS[Semantic(k)] for k in range(len(Semantic))], np.uint8)
Message = list[Any]  # pieces of bytes


@dataclass(eq=False)
class SensorActor(Actor):
    """A sensor."""

    every: float = 0.0
    """s between two messages; 0 for one in each step."""
    due: float = 0.0
    """s of the next."""
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
    if sensor.kind == "sensor.lidar.ray_cast":
        lidar_settings(asked)
    if sensor.kind == "sensor.other.radar":
        radar_settings(asked)
    if sensor.kind == "sensor.other.obstacle":
        _reach(asked)
    return sensor


class Senses:
    """All sensors of a town. Its camera rig is made when it is first needed."""

    def __init__(self, town: Town) -> None:
        self.town = town
        self._rig: CameraRig | None = None
        self._say: dict[str, Callable[[SensorActor, Episode], Iterator[tuple[Sensor, Message]]]] = {
            "sensor.camera.rgb": self._rgb, "sensor.camera.depth": self._depth,
            "sensor.camera.semantic_segmentation": self._semantic, "sensor.other.gnss": _gnss,
            "sensor.other.imu": _imu, "sensor.other.collision": _collisions, "sensor.other.obstacle": _obstacle,
            "sensor.lidar.ray_cast": self._lidar, "sensor.other.radar": self._radar,
        }  # fmt: skip

    def messages(self, sensor: SensorActor, episode: Episode, frame: int) -> Iterator[Message]:
        """What a sensor says now."""
        if episode.time < sensor.due - 1e-6 or sensor.kind not in self._say:
            return
        sensor.due = max(sensor.due + sensor.every, episode.time) if sensor.every else episode.time
        for number, pieces in self._say[sensor.kind](sensor, episode):
            yield [header(number, frame, episode.time, sensor.place), *pieces]

    def warm_up(self, episode: Episode) -> None:
        """Draws something small, so that no client has to wait until that is compiled."""
        scene = episode.scene(Placement(), None)
        camera = PinholeCamera(scene.ego.pose, height=2.0, pitch=0.0, fov=90.0, size=(8, 8))
        self.rig.render_from([camera], scene)
        self.rig.semantics_from(camera, scene)

    def close(self) -> None:
        """Frees the camera."""
        if self._rig is not None:
            self._rig.close()

    @property
    def rig(self) -> CameraRig:
        """The town's."""
        if self._rig is None:
            self._rig = CameraRig(self.town)
        return self._rig

    def _rgb(self, sensor: SensorActor, episode: Episode) -> Iterator[tuple[Sensor, Message]]:
        camera, scene = camera_of(sensor), episode.scene(sensor.place, sensor.parent)
        picture = self.rig.render_from([camera], scene)[0]
        yield Sensor.RGB, _image(sensor, picture[..., ::-1])

    def _semantic(self, sensor: SensorActor, episode: Episode) -> Iterator[tuple[Sensor, Message]]:
        classes = self.rig.semantics_from(camera_of(sensor), episode.scene(sensor.place, sensor.parent))
        yield Sensor.SEMANTIC, _image(sensor, _in_red(_LABELS[classes]))

    def _depth(self, sensor: SensorActor, episode: Episode) -> Iterator[tuple[Sensor, Message]]:
        distances = self.rig.distances_from(camera_of(sensor), episode.scene(sensor.place, sensor.parent))
        shares = np.minimum(distances, FARTHEST).astype(np.float64) / FARTHEST
        steps = (shares * DEPTH_STEPS).astype(np.uint32)
        yield Sensor.DEPTH, _image(sensor, np.stack((steps >> 16, steps >> 8 & 255, steps & 255), axis=-1))

    def _lidar(self, sensor: SensorActor, episode: Episode) -> Iterator[tuple[Sensor, Message]]:
        lidar, rays = lidar_settings(sensor.description), self._rays(sensor, episode)
        found = scan(lidar, sensor.place, sensor.angle, rays)
        sensor.angle = math.fmod(sensor.angle + lidar.turned(rays.delta), lidar.width)
        head = np.array([len(found.counts), *found.counts], "<u4").tobytes()
        points = (found.points * (1.0, -1.0, 1.0, 1.0)).astype("<f4")  # x, y to the right, z, intensity
        yield Sensor.LIDAR, [np.array([sensor.angle], "<f4").tobytes() + head, points.tobytes()]

    def _radar(self, sensor: SensorActor, episode: Episode) -> Iterator[tuple[Sensor, Message]]:
        vx, vy, _ = (sensor.parent or sensor).motion[0]
        found = detections(
            radar_settings(sensor.description), sensor.place, (vx, -vy), episode.bodies(), self._rays(sensor, episode)
        )
        yield Sensor.RADAR, [(found * (1.0, -1.0, 1.0, 1.0)).astype("<f4").tobytes()]  # speed, right, up, distance

    def _rays(self, sensor: SensorActor, episode: Episode) -> Rays:
        """The same in each run of the same program."""
        scene = episode.scene(sensor.place, sensor.parent)
        rng = np.random.default_rng((sensor.id, round(1000 * episode.time)))
        return Rays(max(sensor.every, episode.delta), lambda camera: self.rig.distances_from(camera, scene), rng)


def camera_of(sensor: SensorActor) -> PinholeCamera:
    """Where a camera sensor looks from, and how."""
    at = sensor.place
    return PinholeCamera(at.pose, height=at.z, pitch=at.pitch, fov=sensor.fov, size=sensor.size, roll=at.roll)


def _in_red(labels: Any) -> Any:
    picture = np.zeros((*labels.shape, 3), np.uint8)
    picture[..., 2] = labels
    return picture


def _image(sensor: SensorActor, picture: Any) -> Message:
    """An image (H, W, 3) in the order blue, green, red."""
    width, height = sensor.size
    out = np.full((height, width, 4), 255, np.uint8)
    out[..., :3] = picture
    return [np.array([width, height], "<u4").tobytes() + np.array([sensor.fov], "<f4").tobytes(), out]


def geo_location(place: Placement) -> tuple[float, float, float]:
    """Latitude, longitude (degrees) and height (m) of a place, as CARLA's client reckons them."""
    x, y, z, *_ = to_carla(place)
    return math.degrees(y / EARTH), math.degrees(x / EARTH), z


def _gnss(sensor: SensorActor, episode: Episode) -> Iterator[tuple[Sensor, Message]]:
    yield Sensor.GNSS, [wire.encode(geo_location(sensor.place))]


def _imu(sensor: SensorActor, episode: Episode) -> Iterator[tuple[Sensor, Message]]:
    place = sensor.place
    _, turning, acceleration = sensor.parent.motion if sensor.parent else sensor.motion
    _, _, _, _, yaw, _ = to_carla(place)
    c, s = math.cos(math.radians(yaw)), math.sin(math.radians(yaw))
    ahead, right = c * acceleration[0] + s * acceleration[1], c * acceleration[1] - s * acceleration[0]
    gyro = tuple(math.radians(rate) for rate in turning)
    compass = math.radians((yaw + 90.0) % 360.0)
    yield Sensor.IMU, [wire.encode(((ahead, right, acceleration[2] + GRAVITY), gyro, compass))]


def _collisions(sensor: SensorActor, episode: Episode) -> Iterator[tuple[Sensor, Message]]:
    for vehicle, contact in episode.hits:
        if vehicle is not sensor.parent:
            continue
        heading = vehicle.state.pose.heading
        impulse = (-contact.impulse * math.cos(heading), contact.impulse * math.sin(heading), 0.0)
        yield Sensor.COLLISION, [wire.encode((vehicle.layout(b""), _other(contact.id, episode), impulse))]


def _other(name: str, episode: Episode) -> Any:
    """The actor behind a name, or one that stands for a thing of the town."""
    actor = episode.actor_of(name)
    if actor is not None:
        return actor.layout(b"")
    return 0, 0, description(f"static.{name.rstrip('0123456789')}"), BoundingBox(), bytes([Label.STATIC]), b""


def _reach(asked: ActorDescription) -> tuple[float, float]:
    """How far an obstacle sensor looks, and how far aside (m). Raises Refusal."""
    return asked.number("distance", 5.0, 0.1, 500.0), asked.number("hit_radius", 0.5, 0.01, 50.0)


def _obstacle(sensor: SensorActor, episode: Episode) -> Iterator[tuple[Sensor, Message]]:
    asked, place = sensor.description, sensor.place
    reach, radius = _reach(asked)
    own = sensor.parent.id if sensor.parent else 0
    scene = episode.scene(place, None)
    bodies: Sequence[Any] = (*scene.vehicles, *scene.pedestrians)
    near = [obstacle_of(one) for one in bodies if (actor := episode.actor_of(one.id)) and actor.id != own]
    if asked.get("only_dynamics", "false").lower() != "true":
        near += [*episode.town.obstacles.near(place.pose, reach + radius), *map(prop_box, episode.all(Prop))]
    found = way_ahead(place.pose, reach, radius, near)
    if found is not None:
        mine = (sensor.parent or sensor).layout(b"")
        yield Sensor.OBSTACLE, [wire.encode((mine, _other(found[0].id, episode), found[1]))]
