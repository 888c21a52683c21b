"""The sensors on the ego: cameras, what it touches, and whether all of a step has come.

Messages come in threads of CARLA's client, some time after the step: whoever wants one waits for that of its frame.
"""

from __future__ import annotations

import math
from functools import lru_cache
from queue import Empty, SimpleQueue
from typing import Any

import numpy as np
from numpy.typing import NDArray

from caldrive.carla_bridge.client.connection import PATIENCE, Connection
from caldrive.carla_bridge.client.library import carla_module
from caldrive.datatypes import CameraConfig, Image, Semantic

RGB, SEMANTIC = "sensor.camera.rgb", "sensor.camera.semantic_segmentation"
COLLISION, CLOCK = "sensor.other.collision", "sensor.other.gnss"
CLASSES = {  # of CARLA's semantic labels, by their names; what is none of these is furniture
    "Sky": Semantic.SKY, "Roads": Semantic.ROAD, "RoadLines": Semantic.LINE, "Sidewalks": Semantic.SIDEWALK,
    "Ground": Semantic.GROUND, "Terrain": Semantic.GROUND, "Water": Semantic.GROUND, "RailTrack": Semantic.GROUND,
    "Buildings": Semantic.BUILDING, "Walls": Semantic.BUILDING, "Bridge": Semantic.BUILDING,
    "Vegetation": Semantic.PLANT, "TrafficLight": Semantic.LIGHT, "TrafficSigns": Semantic.SIGN,
    "Car": Semantic.VEHICLE, "Truck": Semantic.VEHICLE, "Bus": Semantic.VEHICLE, "Train": Semantic.VEHICLE,
    "Motorcycle": Semantic.VEHICLE, "Bicycle": Semantic.VEHICLE, "Pedestrians": Semantic.PERSON,
    "Rider": Semantic.PERSON,
}  # fmt: skip


class Sensor:
    """A sensor on an actor, at a place relative to it (CARLA's transform), and what it says."""

    def __init__(self, connection: Connection, carrier: Any, kind: str, place: Any = None, **attributes: Any) -> None:
        blueprint = connection.blueprint(kind, **attributes)
        actor = connection.spawn(blueprint, place or connection.carla.Transform(), carrier)
        if actor is None:
            raise RuntimeError(f"found that CARLA makes no {kind}, wanted one on the ego: start CARLA 0.9.16")
        self.kind = kind
        self.latest: Any = None
        self._heard: SimpleQueue[Any] = SimpleQueue()
        self._actor = actor
        self._actor.listen(self._heard.put)

    def wait_for(self, frame: int) -> None:
        """Waits until `latest` is what it said at a frame. Raises RuntimeError where that does not come."""
        while self.latest is None or self.latest.frame < frame:
            try:
                self.latest = self._heard.get(timeout=PATIENCE)
            except Empty as error:
                raise RuntimeError(
                    f"found nothing from {self.kind} within {PATIENCE:g} s, wanted a message for each step: see "
                    "whether the server still runs, and type the command again"
                ) from error

    def heard(self) -> list[Any]:
        """All that it has said since it was last asked."""
        return [self._heard.get() for _ in range(self._heard.qsize())]


def camera(connection: Connection, carrier: Any, mount: CameraConfig, kind: str, ahead: float) -> Sensor:
    """A camera of a kind on a vehicle. ahead: m from the vehicle's origin to the middle of its box."""
    carla = connection.carla
    location = carla.Location(x=mount.forward + ahead, y=-mount.left, z=mount.up)
    place = carla.Transform(location, carla.Rotation(yaw=-math.degrees(mount.yaw)))
    size = {"image_size_x": mount.width, "image_size_y": mount.height, "fov": mount.fov}
    return Sensor(connection, carrier, kind, place, **size)


def _pixels(image: Any) -> NDArray[np.uint8]:
    """(H, W, 4): blue, green, red and nothing."""
    return np.frombuffer(image.raw_data, np.uint8).reshape(image.height, image.width, 4)


def picture(image: Any) -> Image:
    """(H, W, 3) in RGB."""
    return np.ascontiguousarray(_pixels(image)[..., 2::-1])


def classes(image: Any) -> NDArray[np.uint8]:
    """(H, W) of `Semantic`, from a picture with CARLA's labels in red."""
    return _table()[_pixels(image)[..., 2]]


@lru_cache(maxsize=1)
def _table() -> NDArray[np.uint8]:
    """(256,): the class of each of CARLA's labels."""
    labels = carla_module().CityObjectLabel
    table = np.full(256, Semantic.FURNITURE, np.uint8)
    for name, meaning in CLASSES.items():
        table[int(getattr(labels, name))] = meaning
    return table
