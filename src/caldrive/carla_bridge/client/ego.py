"""The ego: a compact car of CARLA's with the sensors that it carries."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from caldrive.carla_bridge.client.actors import Offset, forward_speed, place_of, transform_of
from caldrive.carla_bridge.client.connection import Connection
from caldrive.carla_bridge.client.sensors import CLOCK, COLLISION, Sensor, camera
from caldrive.datatypes import CameraConfig, Control, Pose, VehicleState
from caldrive.geometry import moved, to_local
from caldrive.world.traffic.ego import VehicleConfig

MODEL = "vehicle.seat.leon"  # as long and as wide as the embedded world's ego
DROP = 0.3  # m above the ground at which it is put down
USUAL = VehicleConfig()
CM = 100.0  # in a m


class Ego:
    """It stands at a pose of ours, height m up, until it is driven. Raises ValueError where something stands there."""

    def __init__(self, connection: Connection, pose: Pose, height: float, offset: Offset) -> None:
        self._connection, self._offset, self._height = connection, offset, height
        blueprint = connection.blueprint(MODEL)
        self._actor = connection.spawn(blueprint, self._transform(pose))
        if self._actor is None:
            raise ValueError(
                f"found something at ({pose.x:.1f}, {pose.y:.1f}), wanted room for the ego: give another --route or "
                "--from"
            )
        self.id = int(self._actor.id)
        self._box = self._actor.bounding_box
        most = max((wheel.max_steer_angle for wheel in self._wheels()), default=0.0) or math.degrees(USUAL.max_steer)
        self._steer_share = min(1.0, USUAL.max_steer / math.radians(most))
        self._hits = Sensor(connection, self._actor, COLLISION)
        self._clock = Sensor(connection, self._actor, CLOCK)
        self._cameras: dict[tuple[CameraConfig, str], Sensor] = {}

    def _transform(self, pose: Pose) -> Any:
        return transform_of(self._connection.carla, pose, self._height + DROP, self._offset)

    def apply(self, control: Control) -> None:
        """Drives so from now on. The wheels turn as far as the embedded world's for the same control."""
        self._actor.apply_control(
            self._connection.carla.VehicleControl(
                throttle=control.throttle, steer=-control.steer * self._steer_share, brake=control.brake
            )
        )

    def put(self, pose: Pose) -> None:
        """It is somewhere else, as high as it was."""
        place = self._transform(pose)
        place.location.z = self._actor.get_transform().location.z
        self._actor.set_transform(place)

    def state(self) -> VehicleState:
        """Where it is and how fast, after the latest step."""
        pose = self._pose()
        speed = max(0.0, forward_speed(self._actor.get_velocity(), pose.heading))
        extent = self._box.extent
        return VehicleState(pose, speed, length=2 * extent.x, width=2 * extent.y, id="ego")

    def _pose(self) -> Pose:
        place = place_of(self._actor.get_transform(), self._offset)
        return moved(place.pose, forward=self._box.location.x, left=-self._box.location.y)

    def front_axle(self) -> float:
        """m from its centre to its front axle; the embedded ego's share of the length where CARLA's wheels are not
        where wheels can be."""
        here, length = self._pose(), 2.0 * float(self._box.extent.x)
        ahead = max((self._ahead(here, wheel.position) for wheel in self._wheels()), default=0.0)
        return ahead if 0.2 * length < ahead < 0.5 * length else USUAL.front_axle / USUAL.length * length

    def _wheels(self) -> Any:
        return self._actor.get_physics_control().wheels

    def _ahead(self, here: Pose, position: Any) -> float:
        """How far (m) ahead of a pose a wheel is."""
        x, y = self._offset
        return float(to_local(here, np.array((position.x / CM - x, -position.y / CM - y)))[0])

    def mount(self, mounts: Sequence[CameraConfig], *kinds: str) -> bool:
        """Mounts cameras where there are none; whether there are new ones, which see nothing before the next step."""
        missing = [key for mount in mounts for kind in kinds if (key := (mount, kind)) not in self._cameras]
        for mount, kind in missing:
            self._cameras[mount, kind] = camera(self._connection, self._actor, mount, kind, self._box.location.x)
        return bool(missing)

    def wait_for(self, frame: int) -> None:
        """Waits until everything has come that its sensors say of a frame."""
        for sensor in (self._clock, *self._cameras.values()):  # each speaks after the collisions of its step
            sensor.wait_for(frame)

    def image(self, mount: CameraConfig, kind: str) -> Any:
        """The latest image of a camera that is mounted."""
        return self._cameras[mount, kind].latest

    def hits(self) -> list[Any]:
        """The collision events since they were last asked for."""
        return self._hits.heard()
