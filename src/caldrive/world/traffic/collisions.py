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
STANDING = 0.3  # m/s below which a car runs into nobody
BUMPER = 0.8  # m from the front on which a person must be touched for it to be the ego's fault
_MASSES = {ContactKind.PERSON: PERSON_MASS, ContactKind.CAR: CAR_MASS, ContactKind.OBJECT: math.inf}


@dataclass(frozen=True)
class Obstacle:
    """A box that may be hit."""

    kind: ContactKind
    id: str
    pose: Pose
    """Of its centre."""
    length: float
    """m along its heading."""
    width: float
    """m."""
    speed: float = 0.0
    """m/s along its heading."""


def obstacle_of(actor: VehicleState | PedestrianState) -> Obstacle:
    """The box around a car or a person."""
    if isinstance(actor, VehicleState):
        return Obstacle(
            ContactKind.CAR, actor.id, actor.pose, length=actor.length, width=actor.width, speed=actor.speed
        )
    size = 2 * actor.radius
    return Obstacle(ContactKind.PERSON, actor.id, actor.pose, length=size, width=size, speed=actor.speed)


def half_diagonal(box: VehicleState | Obstacle) -> float:
    """m from the centre of a box to its corners."""
    return math.hypot(box.length, box.width) / 2


def at_fault(ego: VehicleState, obstacle: Obstacle) -> bool:
    """The ego is at fault where its moving front or flank runs into something, not where it is run into: from behind,
    or by a car that comes towards its flank."""
    ahead, left = to_local(ego.pose, np.array([obstacle.pose.x, obstacle.pose.y])).tolist()
    if ego.speed < STANDING or ahead < 0:
        return obstacle.kind is ContactKind.OBJECT
    if obstacle.kind is ContactKind.PERSON:
        return bool(ahead > ego.length / 2 - BUMPER)
    corners = to_local(ego.pose, box_corners(obstacle.pose, obstacle.length, obstacle.width))
    side = math.copysign(1.0, left)
    into_front, into_flank = ego.length / 2 - corners[:, 0].min(), ego.width / 2 - (side * corners[:, 1]).min()
    heading = obstacle.pose.heading - ego.pose.heading
    return bool(into_front <= into_flank or -side * math.sin(heading) * obstacle.speed < STANDING)


def _impulse(ego: VehicleState, obstacle: Obstacle, normal: Points) -> float:
    """Impulse (N s) of an inelastic hit along a unit normal (2,) that points away from the obstacle."""
    closing = max(0.0, float((_velocity(obstacle) - _velocity(ego)) @ normal))
    mass = _MASSES[obstacle.kind]
    reduced = CAR_MASS if math.isinf(mass) else CAR_MASS * mass / (CAR_MASS + mass)
    return reduced * closing


def _velocity(body: VehicleState | Obstacle) -> Points:
    """(2,) in m/s."""
    return body.speed * np.array([math.cos(body.pose.heading), math.sin(body.pose.heading)])


def resolve(ego: VehicleState, obstacles: Sequence[Obstacle]) -> tuple[VehicleState, tuple[Contact, ...]]:
    """The ego pushed out of what it overlaps and slowed (from behind: sped up) by it, and the contacts; a glancing hit
    slides along."""
    contacts = []
    for obstacle in obstacles:
        apart = math.hypot(obstacle.pose.x - ego.pose.x, obstacle.pose.y - ego.pose.y)
        if apart > half_diagonal(ego) + half_diagonal(obstacle):
            continue
        shift = push_out(
            moving=box_corners(ego.pose, ego.length, ego.width),
            fixed=box_corners(obstacle.pose, obstacle.length, obstacle.width),
        )
        depth = 0.0 if shift is None else float(np.linalg.norm(shift))
        if shift is None or depth < TOUCH:
            continue
        normal = shift / depth
        impulse = _impulse(ego, obstacle, normal)
        contacts.append(Contact(obstacle.kind, obstacle.id, impulse, at_fault=at_fault(ego, obstacle)))
        ego = _pushed(ego, obstacle, shift, impulse)
    return ego, tuple(contacts)


def _pushed(ego: VehicleState, obstacle: Obstacle, shift: Points, impulse: float) -> VehicleState:
    """The ego after a hit: shifted by a vector (2,) in m, its speed changed by an impulse (N s) along that."""
    normal = shift / float(np.linalg.norm(shift))
    along = float(normal @ (math.cos(ego.pose.heading), math.sin(ego.pose.heading)))
    speed = max(0.0, ego.speed + along * impulse / CAR_MASS)
    if obstacle.kind is ContactKind.PERSON:  # a person is knocked aside and does not hold the car
        return replace(ego, speed=speed)
    pose = Pose(ego.pose.x + float(shift[0]), ego.pose.y + float(shift[1]), ego.pose.heading)
    return replace(ego, pose=pose, speed=speed)
