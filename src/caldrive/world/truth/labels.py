"""The true affordances, by the observation areas of supplement 2.1: a pure function of who and what is where.

The areas are rectangles in the frame of the front axle: x ahead of its middle, y to the left. The same function labels
any simulator that can say where things are.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

from caldrive.datatypes import (
    MAX_CENTER_DISTANCE,
    MAX_VEHICLE_DISTANCE,
    Affordances,
    LightState,
    PedestrianState,
    Pose,
    Sign,
    TrafficLight,
    VehicleState,
)
from caldrive.geometry import Polyline, Posed, box_corners, moved, polygon_distance, wrap_angle

IN_VIEW = 5.0  # m from which on a light stands too high to be seen
REACTION, BRAKE = 0.2, 6.0  # s and m/s²: what stopping before a light takes
STRIP = 1.3  # m to either side of the route: half a car and some room
Thing = TypeVar("Thing", bound=Posed)
FACING = math.radians(45)  # a sign or light counts for traffic that runs within this angle of the one it faces


@dataclass(frozen=True)
class Area:
    """A rectangle ahead of the front axle, in m."""

    near: float
    """Least distance forward."""
    far: float
    """Greatest distance forward."""
    right: float
    """Its right side, + to the left."""
    left: float
    """Its left side, + to the left."""

    def among(self, axle: Pose, things: Iterable[Thing]) -> list[tuple[float, Thing]]:
        """Things whose centres lie in it, and how far ahead of the axle each is (m)."""
        c, s, x, y = math.cos(axle.heading), math.sin(axle.heading), axle.x, axle.y
        inside = []
        for thing in things:
            dx, dy = thing.pose.x - x, thing.pose.y - y
            ahead = c * dx + s * dy
            if self.near <= ahead <= self.far and self.right <= c * dy - s * dx <= self.left:
                inside.append((ahead, thing))
        return inside


# The table in supplement 2.1. Its text calls x the lateral axis, but its numbers are (forward, left).
A1 = Area(near=7.4, far=14.0, right=-5.8, left=-0.8)
A2 = Area(near=0.0, far=8.2, right=-2.0, left=2.0)
A3 = Area(near=0.0, far=50.0, right=-1.6, left=1.6)
A2_AND_A3 = Area(near=0.0, far=50.0, right=-2.0, left=2.0)  # around both


def hazard_stop(axle: Pose, vehicles: Sequence[VehicleState], pedestrians: Sequence[PedestrianState]) -> bool:
    """Whether the centre of a car or a person lies in A2. axle: the middle of the ego's front axle."""
    return bool(A2.among(axle, vehicles) or A2.among(axle, pedestrians))


def light_area(speed: float) -> Area:
    """A1, and nearer than that what a car at this speed (m/s) can still stop in with the light in view.

    A1 ends with the bumper 6.6 m before the line: who is slow and brakes there for a yellow light stands outside it,
    where no affordance would tell him of the red one that follows.
    """
    return replace(A1, near=min(A1.near, IN_VIEW + REACTION * speed + speed**2 / (2 * BRAKE)))


def red_light(axle: Pose, lights: Sequence[TrafficLight], speed: float) -> bool:
    """Whether a light that faces the ego and is not green stands in the area for this speed (m/s). Yellow counts, as it
    asks to stop."""
    inside = light_area(speed).among(axle, lights)
    return any(light.state is not LightState.GREEN and faces(light.pose, axle) for _, light in inside)


def speed_sign(axle: Pose, signs: Sequence[Sign]) -> int | None:
    """The limit on the nearest sign in A1 that faces the ego, in km/h."""
    limits = [(ahead, sign.limit) for ahead, sign in A1.among(axle, signs) if faces(sign.pose, axle)]
    return min(limits)[1] if limits else None


def faces(post: Pose, axle: Pose) -> bool:
    """Whether what hangs on a post is meant for those who drive as the axle looks."""
    return abs(wrap_angle(post.heading - axle.heading)) <= FACING


def in_the_way(vehicle: VehicleState, route: Polyline, near: float) -> bool:
    """Whether a car's box reaches into the strip that the ego sweeps along its route.

    The areas are straight, and in a turn they sweep over cars that wait in the opposite lane: who stopped for those
    would stand until they left, while they wait for the ego to clear the junction.
    """
    hit = route.project(vehicle.pose.x, vehicle.pose.y, near, window=MAX_VEHICLE_DISTANCE + 15.0)
    across = abs(math.sin(vehicle.pose.heading - hit.heading)) * vehicle.length / 2
    across += abs(math.cos(vehicle.pose.heading - hit.heading)) * vehicle.width / 2
    return abs(hit.left) - across < STRIP


def vehicle_distance(ego: VehicleState, axle: Pose, vehicles: Sequence[VehicleState]) -> float:
    """Shortest distance between the boxes of the ego and the closest car whose centre is in A3, else 50 m."""
    ahead = [vehicle for _, vehicle in A3.among(axle, vehicles)]
    if not ahead:
        return MAX_VEHICLE_DISTANCE
    own = box_corners(ego.pose, ego.length, ego.width)
    boxes = [box_corners(vehicle.pose, vehicle.length, vehicle.width) for vehicle in ahead]
    return min([*(polygon_distance(own, box) for box in boxes), MAX_VEHICLE_DISTANCE])


def to_line(axle: Pose, line: Polyline, near: float | None = None) -> tuple[float, float, float]:
    """Relative angle (rad) and centre distance (m, without its limits) of a front axle from a line, both positive where
    the wheel has to go left, and the arc length of the line there."""
    hit = line.project(axle.x, axle.y, near)
    return wrap_angle(hit.heading - axle.heading), -hit.left, hit.s


def label(
    ego: VehicleState,
    front_axle: float,
    route: Polyline,
    near: float | None = None,
    vehicles: Sequence[VehicleState] = (),
    pedestrians: Sequence[PedestrianState] = (),
    lights: Sequence[TrafficLight] = (),
    signs: Sequence[Sign] = (),
) -> Affordances:
    """The six affordances (Fig. 3).

    front_axle: metres from the ego's centre to its front axle. route: the line of the command. near: arc length near
    which the ego is on it, if known. Distance and angle are those from car to line: both are positive where the wheel
    has to go left. Cars count in A2 and A3 only where they are in the way.
    """
    axle = moved(ego.pose, forward=front_axle)
    angle, distance, s = to_line(axle, route, near)
    vehicles = [vehicle for _, vehicle in A2_AND_A3.among(axle, vehicles) if in_the_way(vehicle, route, s)]
    return Affordances(
        hazard_stop=float(hazard_stop(axle, vehicles, pedestrians)),
        red_light=float(red_light(axle, lights, ego.speed)),
        speed_sign=speed_sign(axle, signs),
        vehicle_distance=vehicle_distance(ego, axle, vehicles),
        relative_angle=angle,
        center_distance=min(max(distance, -MAX_CENTER_DISTANCE), MAX_CENTER_DISTANCE),
    )
