"""Who touches the clients' vehicles, by the embedded world's collisions; and where there is room for a new one."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import shapely

from caldrive.carla_bridge.server.actors import Actor
from caldrive.carla_bridge.server.vehicles import Vehicle
from caldrive.datatypes import Contact, ContactKind, PedestrianState, Pose, VehicleState
from caldrive.geometry import box_corners, boxes_overlap, moved, push_out
from caldrive.world.town import Obstacles
from caldrive.world.traffic.collisions import Obstacle, half_diagonal, obstacle_of, resolve

SPARE = 0.05  # m that a new vehicle may overlap with others on each side
Body = VehicleState | PedestrianState


class Hit(NamedTuple):
    """A vehicle touched something."""

    vehicle: Vehicle
    contact: Contact
    impulse: tuple[float, float]
    """N s that act on the vehicle, in the world, in our axes."""


def prop_box(prop: Actor) -> Obstacle:
    """The box around a thing that a client put somewhere."""
    extent, pose = prop.box.extent, prop.place.pose
    return Obstacle(ContactKind.OBJECT, f"{prop.kind}#{prop.id}", pose, length=2 * extent.x, width=2 * extent.y)


def resolve_contacts(
    vehicles: Sequence[Vehicle], bodies: Sequence[Body], props: Sequence[Actor], town: Obstacles
) -> list[Hit]:
    """Lets contacts act on the clients' vehicles; bodies: everybody who moves, those vehicles too."""
    hits: list[Hit] = []
    things = [prop_box(prop) for prop in props]
    for vehicle in vehicles:
        if not (vehicle.collides and vehicle.has_physics):
            continue
        start = box = vehicle.box_state()
        near = _near(box, [one for one in bodies if one.id != box.id], things, town)
        for thing in near:
            before, (box, contacts) = box, resolve(box, [thing])
            hits += [Hit(vehicle, contact, _impulse(before, thing, contact.impulse)) for contact in contacts]
        if box is not start:
            vehicle.state = replace(vehicle.state, pose=box.pose, speed=box.speed)
    return hits


def _impulse(box: VehicleState, thing: Obstacle, size: float) -> tuple[float, float]:
    """An impulse that pushes a box out of something the shortest way."""
    corners = box_corners(thing.pose, thing.length, thing.width)
    shift = push_out(moving=box_corners(box.pose, box.length, box.width), fixed=corners)
    if shift is None:
        return 0.0, 0.0
    x, y = (size * shift / np.linalg.norm(shift)).tolist()
    return x, y


def _near(box: VehicleState, bodies: Iterable[Body], things: Iterable[Obstacle], town: Obstacles) -> list[Obstacle]:
    """What a box might touch."""
    here, reach = box.pose, half_diagonal(box)
    moving = [obstacle_of(one) for one in bodies if _is_near(one.pose, here, reach + 8.0)]
    return [*town.near(here, reach), *moving, *(thing for thing in things if _is_near(thing.pose, here, reach + 8.0))]


def _is_near(pose: Pose, here: Pose, reach: float) -> bool:
    return abs(pose.x - here.x) < reach and abs(pose.y - here.y) < reach


def is_free(box: VehicleState, bodies: Iterable[Body], props: Iterable[Actor], town: Obstacles) -> bool:
    """Whether there is room for a body."""
    corners = box_corners(box.pose, box.length - 2 * SPARE, box.width - 2 * SPARE)
    near = _near(box, bodies, [prop_box(prop) for prop in props], town)
    return not any(boxes_overlap(corners, box_corners(one.pose, one.length, one.width)) for one in near)


def way_ahead(pose: Pose, distance: float, radius: float, near: Iterable[Obstacle]) -> tuple[Obstacle, float] | None:
    """What stands first within a distance (m) ahead of a place and so far around the line there, and how far away its
    nearest point of that space is."""
    best: tuple[Obstacle, float] | None = None
    ahead = moved(pose, forward=distance)
    start, line = shapely.Point(pose.x, pose.y), shapely.LineString(((pose.x, pose.y), (ahead.x, ahead.y)))
    capsule = line.buffer(radius)
    for one in near:
        if not _is_near(one.pose, pose, distance + radius + half_diagonal(one)):
            continue
        part = capsule.intersection(shapely.Polygon(box_corners(one.pose, one.length, one.width)))
        away = math.inf if part.is_empty else start.distance(part)
        if away <= distance and (best is None or away < best[1]):
            best = one, away
    return best
