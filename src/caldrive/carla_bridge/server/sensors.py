"""What the sensors that clients spawn say after a step: those with pictures and rays here, others in `instruments`."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from caldrive.carla_bridge.axes import Placement
from caldrive.carla_bridge.server.actors import Label
from caldrive.carla_bridge.server.episode import Episode
from caldrive.carla_bridge.server.instances import Body, Pictures, instances, semantic_scan, with_cosines
from caldrive.carla_bridge.server.instruments import collisions, gnss, imu, obstacle
from caldrive.carla_bridge.server.lidar import Rays, lidar_settings, scan
from caldrive.carla_bridge.server.log import Log
from caldrive.carla_bridge.server.radar import detections, radar_settings
from caldrive.carla_bridge.server.sensor_actors import Message, SensorActor
from caldrive.carla_bridge.server.snapshot import Sensor, header
from caldrive.compiled import compiled
from caldrive.datatypes import Semantic
from caldrive.world.rendering.camera import CameraRig, SceneState
from caldrive.world.rendering.pinhole import PinholeCamera
from caldrive.world.town import Town

FARTHEST = 1000.0  # m that a depth image reaches
DEPTH_STEPS = 256**3 - 1
SEMANTIC_POINT = np.dtype([("place", "<f4", 3), ("cosine", "<f4"), ("id", "<u4"), ("label", "<u4")])
LABELS = {
    Semantic.SKY: Label.SKY, Semantic.ROAD: Label.ROAD, Semantic.LINE: Label.LINE, Semantic.SIDEWALK: Label.SIDEWALK,
    Semantic.GROUND: Label.TERRAIN, Semantic.BUILDING: Label.BUILDING, Semantic.PLANT: Label.VEGETATION,
    Semantic.FURNITURE: Label.STATIC, Semantic.LIGHT: Label.LIGHT, Semantic.SIGN: Label.SIGN,
    Semantic.VEHICLE: Label.CAR, Semantic.PERSON: Label.PEDESTRIAN,
}  # fmt: skip
_LABELS = np.array([LABELS[Semantic(k)] for k in range(len(Semantic))], np.uint8)


class Senses:
    """All sensors of a town. Its camera rig is made when it is first needed."""

    def __init__(self, town: Town) -> None:
        self.town = town
        self._rig: CameraRig | None = None
        self._say: dict[str, Callable[[SensorActor, Episode], Iterator[tuple[Sensor, Message]]]] = {
            "sensor.camera.rgb": self._rgb, "sensor.camera.depth": self._depth,
            "sensor.camera.semantic_segmentation": self._semantic, "sensor.other.gnss": gnss,
            "sensor.camera.instance_segmentation": self._instances, "sensor.other.imu": imu,
            "sensor.other.collision": collisions, "sensor.other.obstacle": obstacle,
            "sensor.lidar.ray_cast": self._lidar, "sensor.lidar.ray_cast_semantic": self._semantic_lidar,
            "sensor.other.radar": self._radar,
        }  # fmt: skip

    def messages(self, sensor: SensorActor, episode: Episode, frame: int) -> Iterator[Message]:
        """What a sensor says now."""
        if episode.time < sensor.due - 1e-6 or sensor.kind not in self._say:
            return
        is_late = episode.time - sensor.due >= sensor.every
        sensor.due = sensor.every + (episode.time if is_late else sensor.due)
        for number, pieces in self._say[sensor.kind](sensor, episode):
            yield [header(number, frame, episode.time, sensor.place), *pieces]

    def heard(self, sensor: SensorActor, episode: Episode, frame: int, log: Log) -> list[Message]:
        """Likewise. A fault silences it."""
        try:
            return list(self.messages(sensor, episode, frame))
        except Exception as error:  # a place or a lens that nobody thought of
            log(f"found a fault in {sensor.kind} ({type(error).__name__}: {error}), wanted none: it falls silent")
            sensor.is_silent = True
            return []

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
        pixels = np.empty((*picture.shape[:2], 4), np.uint8)
        reordered(picture, pixels)
        yield Sensor.RGB, _with_size(sensor, pixels)

    def _semantic(self, sensor: SensorActor, episode: Episode) -> Iterator[tuple[Sensor, Message]]:
        classes = self.rig.semantics_from(camera_of(sensor), episode.scene(sensor.place, sensor.parent))
        yield Sensor.SEMANTIC, _image(sensor, _in_red(_LABELS[classes]))

    def _depth(self, sensor: SensorActor, episode: Episode) -> Iterator[tuple[Sensor, Message]]:
        distances = self.rig.distances_from(camera_of(sensor), episode.scene(sensor.place, sensor.parent))
        shares = np.minimum(distances, FARTHEST).astype(np.float64) / FARTHEST
        steps = (shares * DEPTH_STEPS).astype(np.uint32)
        yield Sensor.DEPTH, _image(sensor, np.stack((steps >> 16, steps >> 8 & 255, steps & 255), axis=-1))

    def _instances(self, sensor: SensorActor, episode: Episode) -> Iterator[tuple[Sensor, Message]]:
        scene, camera = episode.scene(sensor.place, sensor.parent), camera_of(sensor)
        distances, classes = self._pictures(scene)(camera)
        bodies: list[Body] = [*scene.vehicles, *scene.pedestrians]
        ids = _ids(bodies, episode)[instances(camera, distances, classes, bodies)]
        picture = _in_red(_LABELS[classes])
        picture[..., 1], picture[..., 0] = ids & 255, ids >> 8 & 255
        yield Sensor.INSTANCE, _image(sensor, picture)

    def _lidar(self, sensor: SensorActor, episode: Episode) -> Iterator[tuple[Sensor, Message]]:
        lidar, rays = lidar_settings(sensor.description), self._rays(sensor, episode)
        found = scan(lidar, sensor.place, sensor.angle, rays)
        head = _turn_on(sensor, lidar.turned(rays.delta), lidar.width, found.counts)
        points = (found.points * (1.0, -1.0, 1.0, 1.0)).astype("<f4")  # x, y to the right, z, intensity
        yield Sensor.LIDAR, [head, points.tobytes()]

    def _semantic_lidar(self, sensor: SensorActor, episode: Episode) -> Iterator[tuple[Sensor, Message]]:
        lidar, scene = lidar_settings(sensor.description), episode.scene(sensor.place, sensor.parent)
        bodies: list[Body] = [*scene.vehicles, *scene.pedestrians]
        rays = self._rays(sensor, episode)._replace(views=with_cosines(self._pictures(scene)))
        found = semantic_scan(lidar, sensor.place, sensor.angle, rays, bodies)
        head = _turn_on(sensor, lidar.turned(rays.delta), lidar.width, found.counts)
        points = np.zeros(len(found.points), SEMANTIC_POINT)
        points["place"], points["cosine"] = found.points * (1.0, -1.0, 1.0), found.cosines
        points["id"], points["label"] = _ids(bodies, episode)[found.bodies], _LABELS[found.classes]
        yield Sensor.SEMANTIC_LIDAR, [head, points.tobytes()]

    def _radar(self, sensor: SensorActor, episode: Episode) -> Iterator[tuple[Sensor, Message]]:
        vx, vy, _ = (sensor.parent or sensor).motion[0]
        found = detections(
            radar_settings(sensor.description), sensor.place, (vx, -vy), episode.bodies(), self._rays(sensor, episode)
        )
        yield Sensor.RADAR, [(found * (1.0, -1.0, 1.0, 1.0)).astype("<f4").tobytes()]  # speed, right, up, distance

    def _rays(self, sensor: SensorActor, episode: Episode) -> Rays:
        """The same in each run of the same program."""
        scene = episode.scene(sensor.place, sensor.parent)
        number, wish = sensor.id - episode.spectator.id, sensor.description.number("noise_seed", 0, 0, 2**32)
        rng = np.random.default_rng((int(wish), number, round(1000 * episode.time)))
        views = lambda camera: self.rig.distances_from(camera, scene)[..., None]  # noqa: E731
        return Rays(max(sensor.every, episode.delta), views, rng)

    def _pictures(self, scene: SceneState) -> Pictures:
        return lambda camera: (self.rig.distances_from(camera, scene), self.rig.semantics_from(camera, scene))


def _turn_on(sensor: SensorActor, turned: float, width: float, counts: NDArray[Any]) -> bytes:
    """Turns a lidar on, and gives the head of its message."""
    sensor.angle = math.fmod(sensor.angle + turned, width)
    return np.array([sensor.angle], "<f4").tobytes() + np.array([len(counts), *counts], "<u4").tobytes()


def _ids(bodies: Sequence[Body], episode: Episode) -> NDArray[np.uint32]:
    """The numbers of the actors that bodies belong to; the last one stands for none."""
    actors = [episode.actor_of(body.id) for body in bodies]
    return np.array([*(actor.id if actor else 0 for actor in actors), 0], np.uint32)


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
    return _with_size(sensor, out)


def _with_size(sensor: SensorActor, pixels: NDArray[np.uint8]) -> Message:
    """An image (H, W, 4) behind its size."""
    width, height = sensor.size
    return [np.array([width, height], "<u4").tobytes() + np.array([sensor.fov], "<f4").tobytes(), pixels]


@compiled
def reordered(picture: NDArray[np.uint8], out: NDArray[np.uint8]) -> None:
    """Writes an image of red, green, blue (H, W, 3) as blue, green, red and 255 (H, W, 4)."""
    for row in range(picture.shape[0]):
        for column in range(picture.shape[1]):
            for channel in range(3):
                out[row, column, channel] = picture[row, column, 2 - channel]
            out[row, column, 3] = 255
