"""The true affordances, by the observation areas of supplement 2.1: a pure function of who and what is where.

The areas are rectangles in the frame of the front axle: x ahead of its middle, y to the left. The same function labels
any simulator that can say where things are.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from caldrive.datatypes import (
    MAX_CENTER_DISTANCE,
    MAX_VEHICLE_DISTANCE,
    Affordances,
    LightState,
    PedestrianState,
    Points,
    Pose,
    Sign,
    TrafficLight,
    VehicleState,
)
from caldrive.geometry import Polyline, box_corners, moved, polygon_distance, positions, to_local, wrap_angle

IN_VIEW = 5.0  # m from which on a light stands too high to be seen
REACTION, BRAKE = 0.2, 6.0  # s and m/s²: what stopping before a light takes
STRIP = 1.3  # m to either side of the route: half a car and some room
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

    def contains(self, points: Points) -> NDArray[np.bool_]:
        """Which points (..., 2) of the axle's frame lie in it."""
        x, y = points[..., 0], points[..., 1]
        return np.asarray((x >= self.near) & (x <= self.far) & (y >= self.right) & (y <= self.left))


# The table in supplement 2.1. Its text calls x the lateral axis, but its numbers are (forward, left).
A1 = Area(near=7.4, far=14.0, right=-5.8, left=-0.8)
A2 = Area(near=0.0, far=8.2, right=-2.0, left=2.0)
A3 = Area(near=0.0, far=50.0, right=-1.6, left=1.6)


def hazard_stop(axle: Pose, vehicles: Sequence[VehicleState], pedestrians: Sequence[PedestrianState]) -> bool:
    """Whether the centre of a car or a person lies in A2. axle: the middle of the ego's front axle."""
    both = np.concatenate((positions(vehicles), positions(pedestrians)))
    return bool(A2.contains(to_local(axle, both)).any())


def light_area(speed: float) -> Area:
    """A1, and nearer than that what a car at this speed (m/s) can still stop in with the light in view.

    A1 ends with the bumper 6.6 m before the line: who is slow and brakes there for a yellow light stands outside it,
    where no affordance would tell him of the red one that follows.
    """
    return replace(A1, near=min(A1.near, IN_VIEW + REACTION * speed + speed**2 / (2 * BRAKE)))


def red_light(axle: Pose, lights: Sequence[TrafficLight], speed: float) -> bool:
    """Whether a light that faces the ego and is not green stands in the area for this speed (m/s). Yellow counts, as it
    asks to stop."""
    area = light_area(speed)
    for light in lights:
        if light.state is LightState.GREEN or abs(wrap_angle(light.pose.heading - axle.heading)) > FACING:
            continue
        if area.contains(to_local(axle, np.array([light.pose.x, light.pose.y]))):
            return True
    return False


def speed_sign(axle: Pose, signs: Sequence[Sign]) -> int | None:
    """The limit on the nearest sign in A1 that faces the ego, in km/h."""
    local = to_local(axle, positions(signs))
    limits = [
        (x, sign.limit)
        for x, inside, sign in zip(local[:, 0], A1.contains(local), signs, strict=True)
        if inside and abs(wrap_angle(sign.pose.heading - axle.heading)) <= FACING
    ]
    return min(limits)[1] if limits else None


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
    ahead = np.flatnonzero(A3.contains(to_local(axle, positions(vehicles))))
    own = box_corners(ego.pose, ego.length, ego.width)
    boxes = [box_corners(v.pose, v.length, v.width) for v in (vehicles[int(i)] for i in ahead)]
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
    local = to_local(axle, positions(vehicles))
    ahead = A3.contains(local) | A2.contains(local)
    vehicles = [v for v, seen in zip(vehicles, ahead, strict=True) if seen and in_the_way(v, route, s)]
    return Affordances(
        hazard_stop=float(hazard_stop(axle, vehicles, pedestrians)),
        red_light=float(red_light(axle, lights, ego.speed)),
        speed_sign=speed_sign(axle, signs),
        vehicle_distance=vehicle_distance(ego, axle, vehicles),
        relative_angle=angle,
        center_distance=float(np.clip(distance, -MAX_CENTER_DISTANCE, MAX_CENTER_DISTANCE)),
    )
