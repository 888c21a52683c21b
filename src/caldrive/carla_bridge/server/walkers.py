"""People that clients walk: a direction and a speed, or a place after the other from the client's own crowd."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

from caldrive.carla_bridge.axes import Placement, vector_to_carla
from caldrive.carla_bridge.server.actors import STILL, Actor
from caldrive.carla_bridge.server.layouts import WalkerControl
from caldrive.carla_bridge.server.snapshot import NOTHING
from caldrive.datatypes import PedestrianState, Pose

HEIGHT, RADIUS = 1.86, 0.3  # m
UP = HEIGHT / 2  # m above the ground: a walker's origin is the middle of the body
FASTEST = 20.0  # m/s


@dataclass(eq=False)
class Walker(Actor):
    """Somebody who walks."""

    control: WalkerControl = WalkerControl()
    by_crowd: float | None = None
    """m/s at which the client's crowd has moved them since the last step."""
    before: Pose = field(default=Pose(0.0, 0.0, 0.0))
    """Where they were at the last step."""

    @property
    def place(self) -> Placement:
        """Where they are: they walk by themselves, whatever they are attached to."""
        return self.own_place

    def step(self, dt: float) -> None:
        """Walks on for dt seconds."""
        at, control = self.own_place, self.control
        if self.is_aside:
            self.motion, self.before = STILL, at.pose
            return
        if self.by_crowd is None:
            direction, speed = control.direction, min(max(control.speed, 0.0), FASTEST)
            size = math.hypot(direction.x, direction.y)
            if speed > 0.0 and size > 1e-6:
                x, y = direction.x / size, -direction.y / size
                at = replace(at, x=at.x + x * speed * dt, y=at.y + y * speed * dt, heading=math.atan2(y, x))
        self.own_place, self.by_crowd = replace(at, z=UP), None
        x, y = (at.x - self.before.x) / dt, (at.y - self.before.y) / dt
        if math.hypot(x, y) > 2 * FASTEST:  # they were put elsewhere
            x = y = 0.0
        self.motion = (vector_to_carla(x, y), NOTHING, NOTHING)
        self.before = at.pose

    def follow(self, place: Placement, speed: float) -> None:
        """The client's crowd has moved them to a place, at a speed (m/s)."""
        self.own_place, self.by_crowd = place, speed
        direction = type(self.control.direction)(math.cos(place.heading), -math.sin(place.heading))
        self.control = WalkerControl(direction, min(max(speed, 0.0), FASTEST))

    def state(self, on_road: bool) -> PedestrianState:
        """As the embedded world knows people."""
        (vx, vy, _), name = self.motion[0], f"{self.kind}#{self.id}"
        return PedestrianState(self.own_place.pose, math.hypot(vx, vy), RADIUS, on_road, name)
