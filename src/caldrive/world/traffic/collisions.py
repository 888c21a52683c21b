"""Who touches the ego, found exactly with oriented boxes, and what that does to the ego."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from caldrive.datatypes import Contact, ContactKind, PedestrianState, Points, Pose, VehicleState
from caldrive.geometry import box_corners, push_out, to_local

PERSON_MASS, CAR_MASS = 75.0, 1400.0  # kg
TOUCH = 1e-6  # m: boxes that overlap by less, as after a push, have no contact


@dataclass(frozen=True)
class Obstacle:
    """A box that may be hit. speed: along its heading, m/s."""

    kind: ContactKind
    id: str
    pose: Pose
    length: float
    width: float
    speed: float = 0.0


def obstacle_of(thing: VehicleState | PedestrianState) -> Obstacle:
    if isinstance(thing, VehicleState):
        return Obstacle(ContactKind.CAR, thing.id, thing.pose, thing.length, thing.width, thing.speed)
    return Obstacle(ContactKind.PERSON, thing.id, thing.pose, 2 * thing.radius, 2 * thing.radius, thing.speed)


def _at_fault(ego: VehicleState, touch: Points, other: Obstacle) -> bool:
    """The ego is at fault where its moving front or flank runs into something, not where it is run into."""
    x = float(to_local(ego.pose, touch)[0])
    if ego.speed < 0.3 or x < 0:
        return other.kind is ContactKind.OBJECT
    if other.kind is ContactKind.PERSON:
        return bool(x > ego.length / 2 - 0.8)
    return True


def _impulse(ego: VehicleState, other: Obstacle, normal: Points) -> float:
    """Impulse (N s) of an inelastic hit along a unit normal that points away from the obstacle."""
    own = ego.speed * np.array([math.cos(ego.pose.heading), math.sin(ego.pose.heading)])
    his = other.speed * np.array([math.cos(other.pose.heading), math.sin(other.pose.heading)])
    closing = max(0.0, float((his - own) @ normal))
    mass = {ContactKind.PERSON: PERSON_MASS, ContactKind.CAR: CAR_MASS, ContactKind.OBJECT: math.inf}[other.kind]
    reduced = CAR_MASS if math.isinf(mass) else CAR_MASS * mass / (CAR_MASS + mass)
    return reduced * closing


def resolve(ego: VehicleState, obstacles: Sequence[Obstacle]) -> tuple[VehicleState, tuple[Contact, ...]]:
    """The ego pushed out of what it overlaps and slowed (from behind: sped up) by it; a glancing hit slides along."""
    contacts = []
    for other in obstacles:
        reach = math.hypot(ego.length + other.length, ego.width + other.width) / 2
        if math.hypot(other.pose.x - ego.pose.x, other.pose.y - ego.pose.y) > reach:
            continue
        shift = push_out(
            box_corners(ego.pose, ego.length, ego.width), box_corners(other.pose, other.length, other.width)
        )
        depth = 0.0 if shift is None else float(np.linalg.norm(shift))
        if shift is None or depth < TOUCH:
            continue
        normal = shift / depth
        impulse = _impulse(ego, other, normal)
        touch = np.array([other.pose.x, other.pose.y])
        contacts.append(Contact(other.kind, other.id, impulse, _at_fault(ego, touch, other)))
        ego = _pushed(ego, other, shift, normal, impulse)
    return ego, tuple(contacts)


def _pushed(ego: VehicleState, other: Obstacle, shift: Points, normal: Points, impulse: float) -> VehicleState:
    along = float(normal @ (math.cos(ego.pose.heading), math.sin(ego.pose.heading)))
    speed = max(0.0, ego.speed + along * impulse / CAR_MASS)
    if other.kind is ContactKind.PERSON:  # a person is knocked aside and does not hold the car
        return replace(ego, speed=speed)
    pose = Pose(ego.pose.x + float(shift[0]), ego.pose.y + float(shift[1]), ego.pose.heading)
    return replace(ego, pose=pose, speed=speed)
