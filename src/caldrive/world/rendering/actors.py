"""Cars and people as a picture draws them: what each looks like follows from its id, where it stands from its state."""

from __future__ import annotations

import math
import zlib
from collections.abc import Iterable, Iterator, Mapping
from functools import lru_cache
from typing import NamedTuple, TypeVar

import numpy as np

from caldrive.compiled import Floats, Integers
from caldrive.datatypes import PedestrianState, Semantic, VehicleState
from caldrive.world.rendering.pinhole import Frustum
from caldrive.world.scene import cars, people
from caldrive.world.scene.cars import SHAPES
from caldrive.world.scene.ground import KERB_HEIGHT
from caldrive.world.scene.meshes import RGB
from caldrive.world.scene.people import Shown

STRIDE = 0.75  # m of one step
SWING = 0.30  # rad of the limbs at 1 m/s
FASTEST_SWING = 1.6  # m/s from which on limbs swing no wider
STANDS = 0.3  # m/s below which the brake lamps are lit
CAR_DETAIL, PERSON_DETAIL = 22.0, 14.0  # m within which the fine meshes are drawn, for a small picture
CAR_FAR, PERSON_FAR = 160.0, 80.0  # m beyond which nobody is drawn
REACH = 6.0  # m around an actor in which something of it, or of its shadow, may be in view
BLACK: RGB = (0, 0, 0)
COLORS = 12  # numbers of an actor's four colours
PEOPLE = 2 * len(SHAPES)  # the first mesh of people
BODIES = {Shown.LEGS | Shown.TORSO: PEOPLE, Shown.LEGS: PEOPLE + 2, Shown.TORSO: PEOPLE + 4}
NOTHING_HIDDEN: Mapping[str, Shown] = {}
Row = tuple[float, ...]
Actor = TypeVar("Actor", VehicleState, PedestrianState)


class Actors(NamedTuple):
    """N cars and people, and M of their shadows."""

    meshes: Integers
    """(N,), as in `actor_meshes`."""
    classes: Integers
    """(N,) of `Semantic`."""
    places: Floats
    """(N, 7): x, y in m, cosine and sine of the heading, cosine and sine of the angle that limbs swing by, m above the
    road."""
    scales: Floats
    """(N, 3): along, across, up."""
    colors: Floats
    """(N, COLORS), of slots 1 to 4, in [0, 1]."""
    shadows: Floats
    """(M, 8): x, y, heading, height, half length, half width (m), darkness underneath, height of the ground."""


def seen_actors(
    frustum: Frustum, zoom: float, vehicles: Iterable[VehicleState], pedestrians: Iterable[PedestrianState],
    shown: Mapping[str, Shown] = NOTHING_HIDDEN,
) -> Actors:  # fmt: skip
    """Those in view. zoom: how many times as far as in a small picture they are seen. shown: what is drawn of people,
    by id, where that is not the whole."""
    kinds, bodies, shadows = list[tuple[int, int]](), list[Row](), list[Row]()
    for vehicle, away in _in_view(frustum, vehicles, CAR_FAR * zoom):
        look = _car_look(vehicle.id)
        kinds.append((2 * look[0] + (away > CAR_DETAIL * zoom), int(Semantic.VEHICLE)))
        bodies.append(_car_row(vehicle, look[1]))
        shadows.append(_car_shadow(vehicle, look[0]))
    for person, away in _in_view(frustum, pedestrians, PERSON_FAR * zoom):
        part, figure = shown.get(person.id, Shown.WHOLE), _person_look(person.id)
        if body := BODIES.get(part & ~Shown.SHADOW):
            kinds.append((body + (away > PERSON_DETAIL * zoom), int(Semantic.PERSON)))
            bodies.append(_person_row(person, *figure))
        if Shown.SHADOW in part:
            shadows.append(_person_shadow(person, figure[0]))
    meshes, classes = np.array(kinds, np.int32).reshape(-1, 2).T.copy()
    table = np.array(bodies, np.float32).reshape(-1, 10 + COLORS)
    places, scales, colors = (table[:, part].copy() for part in (slice(7), slice(7, 10), slice(10, None)))
    return Actors(meshes, classes, places, scales, colors, np.array(shadows, np.float32).reshape(-1, 8))


def _in_view(frustum: Frustum, actors: Iterable[Actor], far: float) -> Iterator[tuple[Actor, float]]:
    """Those less than far (m) away of which something may be in view, each with the m to it."""
    (x, y, _), (ahead_x, ahead_y), (left_x, left_y) = frustum.eye, frustum.ahead, frustum.left
    tangent, slack = frustum.tangent, REACH * math.hypot(1.0, frustum.tangent)
    for actor in actors:
        dx, dy = actor.pose.x - x, actor.pose.y - y
        ahead = ahead_x * dx + ahead_y * dy
        if ahead > -REACH and abs(left_x * dx + left_y * dy) - ahead * tangent < slack:
            away = math.hypot(dx, dy)
            if away < far:
                yield actor, away


def _seed(id: str) -> int:
    """A number from which an actor's looks follow."""
    return zlib.crc32(id.encode()) >> 3


@lru_cache(maxsize=4096)
def _bright(*colors: RGB) -> Row:
    return tuple(value / 255 for color in colors for value in color)


@lru_cache(maxsize=4096)
def _car_look(id: str) -> tuple[int, Row]:
    """A car's shape, and its paint."""
    seed = _seed(id)
    return seed // len(cars.PAINTS) % len(SHAPES), _bright(cars.PAINTS[seed % len(cars.PAINTS)])


@lru_cache(maxsize=4096)
def _person_look(id: str) -> tuple[float, Row]:
    """A person's height over that of the mesh, and colours."""
    seed, palettes = _seed(id), (people.UPPERS, people.TROUSERS, people.SKINS, people.HAIRS)
    colors = _bright(*(palette[seed // 7**k % len(palette)] for k, palette in enumerate(palettes)))
    return float(people.heights(np.array(seed))) / people.HEIGHT, colors


def _car_row(car: VehicleState, paint: Row) -> Row:
    """A row each of Actors.places, scales and colors."""
    tail = cars.BRAKE_LAMP if car.speed < STANDS else cars.TAIL_LAMP
    return (
        car.pose.x, car.pose.y, math.cos(car.pose.heading), math.sin(car.pose.heading), 1.0, 0.0, 0.0,
        car.length / cars.LENGTH, car.width / cars.WIDTH, 1.0,
        *paint, *_bright(tail, cars.HEAD_LAMP, BLACK),
    )  # fmt: skip


def _car_shadow(car: VehicleState, shape: int) -> Row:
    half_length = car.length / cars.LENGTH * (cars.LENGTH / 2 - 0.15)
    half_width = car.width / cars.WIDTH * (cars.WIDTH / 2 - 0.05)
    height = 0.85 * SHAPES[shape].height
    return car.pose.x, car.pose.y, car.pose.heading, height, half_length, half_width, 0.75, 0.02


def _person_row(person: PedestrianState, height: float, colors: Row) -> Row:
    """Likewise. A person's steps follow from the way covered, so that no foot slides."""
    x, y, heading = person.pose.x, person.pose.y, person.pose.heading
    cosine, sine = math.cos(heading), math.sin(heading)
    swing = SWING * min(person.speed, FASTEST_SWING) * math.sin(math.pi / STRIDE * (x * cosine + y * sine))
    return x, y, cosine, sine, math.cos(swing), math.sin(swing), _lift(person), height, height, height, *colors


def _person_shadow(person: PedestrianState, height: float) -> Row:
    return person.pose.x, person.pose.y, person.pose.heading, 1.7 * height, 0.12, 0.22, 0.45, 0.02 + _lift(person)


def _lift(person: PedestrianState) -> float:
    """m above the road."""
    return 0.0 if person.on_road else KERB_HEIGHT
