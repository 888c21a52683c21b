"""Who touches the clients' vehicles, by the embedded world's collisions; and where there is room for a new one."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import NamedTuple

from caldrive.carla_bridge.server.actors import Actor
from caldrive.carla_bridge.server.vehicles import Vehicle
from caldrive.datatypes import Contact, ContactKind, PedestrianState, Pose, VehicleState
from caldrive.geometry import box_corners, boxes_overlap
from caldrive.world.town import Obstacles
from caldrive.world.traffic.collisions import Obstacle, half_diagonal, obstacle_of, resolve

SPARE = 0.05  # m that a new vehicle may overlap with others on each side
Body = VehicleState | PedestrianState


class Hit(NamedTuple):
    """A vehicle touched something."""

    vehicle: Vehicle
    contact: Contact


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
        box = vehicle.box_state()
        near = _near(box, [one for one in bodies if one.id != box.id], things, town)
        after, contacts = resolve(box, near)
        if contacts:
            vehicle.state = replace(vehicle.state, pose=after.pose, speed=after.speed)
            hits += [Hit(vehicle, contact) for contact in contacts]
    return hits


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
    """What stands first within a distance (m) ahead of a place and so far to its sides, and how far away it is."""
    best: tuple[Obstacle, float] | None = None
    c, s = math.cos(pose.heading), math.sin(pose.heading)
    middle = Pose(pose.x + c * distance / 2, pose.y + s * distance / 2, pose.heading)
    corridor = box_corners(middle, distance, 2 * radius)
    for one in near:
        corners = box_corners(one.pose, one.length, one.width)
        if not boxes_overlap(corridor, corners):
            continue
        away = max(0.0, float(((corners - (pose.x, pose.y)) @ (c, s)).min()))
        if best is None or away < best[1]:
            best = one, away
    return best
