"""Cars and people as instances: what each looks like follows from its id, where it stands from its state."""

from __future__ import annotations

import math
import zlib
from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from caldrive.datatypes import PedestrianState, VehicleState
from caldrive.world import cars, people
from caldrive.world.tiles import View

# placed: x, y, heading, phase of the gait (rad). scale: along, across, up, swing of the limbs (rad). colors: slots 1 to 4,
# and in the last byte whether it stands on the sidewalk.
INSTANCE = np.dtype([("placed", "4f4"), ("scale", "4f4"), ("colors", "16u1")])
Instances = NDArray[np.void]
STRIDE = 0.75  # m of one step
CAR_DETAIL, PERSON_DETAIL = 22.0, 14.0  # m within which the fine mesh is drawn
CAR_FAR, PERSON_FAR = 160.0, 80.0  # m beyond which nothing is drawn
N_CAR_SHAPES = len(cars.SHAPES)


@lru_cache(maxsize=4096)
def _seed(id: str) -> int:
    return zlib.crc32(id.encode()) >> 3


@lru_cache(maxsize=4096)
def _car_look(id: str, stands: bool) -> tuple[int, NDArray[np.uint8]]:
    """Index of the shape, and the colours of paint, tail lamps and head lamps."""
    seed = _seed(id)
    paint = cars.PAINTS[seed % len(cars.PAINTS)]
    colors = np.array((*paint, 0, *cars.tail_color(stands), 0, 238, 236, 222, 0, 0, 0, 0, 0), np.uint8)
    return seed // len(cars.PAINTS) % N_CAR_SHAPES, colors


@lru_cache(maxsize=4096)
def _person_look(id: str) -> tuple[float, NDArray[np.uint8]]:
    """Height over that of the mesh, and the colours of clothes, skin and hair."""
    seed = _seed(id)
    colors = np.array([(*c, 0) for c in people.colors_of(seed)], np.uint8).ravel()
    return people.height_of(seed) / people.HEIGHT, colors


def car_instances(vehicles: Sequence[VehicleState]) -> tuple[Instances, NDArray[np.int_]]:
    """Instances (N,) and the index of each car's shape."""
    made, shapes = np.zeros(len(vehicles), INSTANCE), np.zeros(len(vehicles), dtype=int)
    if not vehicles:
        return made, shapes
    looks = [_car_look(v.id, v.speed < 0.3) for v in vehicles]
    made["placed"] = [(v.pose.x, v.pose.y, v.pose.heading, 0.0) for v in vehicles]
    made["scale"] = [(v.length / cars.LENGTH, v.width / cars.WIDTH, 1.0, 0.0) for v in vehicles]
    made["colors"] = [colors for _, colors in looks]
    shapes[:] = [shape for shape, _ in looks]
    return made, shapes


def _gait(person: PedestrianState) -> tuple[float, float]:
    """Phase and swing of the limbs (rad): steps follow from the way covered, so that no foot slides."""
    p = person.pose
    way = p.x * math.cos(p.heading) + p.y * math.sin(p.heading)
    return math.pi * way / STRIDE, min(person.speed, 1.6) * 0.30


def person_instances(pedestrians: Sequence[PedestrianState]) -> Instances:
    """Instances (N,)."""
    made = np.zeros(len(pedestrians), INSTANCE)
    if not pedestrians:
        return made
    looks, gaits = [_person_look(p.id) for p in pedestrians], [_gait(p) for p in pedestrians]
    made["placed"] = [(p.pose.x, p.pose.y, p.pose.heading, g[0]) for p, g in zip(pedestrians, gaits, strict=True)]
    made["scale"] = [(h, h, h, g[1]) for (h, _), g in zip(looks, gaits, strict=True)]
    made["colors"] = [colors for _, colors in looks]
    made["colors"][:, 15] = [0 if p.on_road else 255 for p in pedestrians]
    return made


def in_view(made: Instances, view: View, far: float) -> tuple[NDArray[np.bool_], NDArray[np.float64]]:
    """Which instances can be seen, and how far away all are (m)."""
    at = made["placed"][:, :2].astype(float)
    distance = np.hypot(*(at - view.eye[:2]).T)
    return view.sees(at, 3.0) & (distance < far), distance


def car_shadows(cars_made: Instances, shapes: NDArray[np.int_]) -> NDArray[np.float64]:
    """What throws shadows (N, 8): x, y, heading, height; half length, half width, darkness underneath, height of the ground."""
    heights = 0.85 * np.array(cars.HEIGHTS)[shapes]
    return _shadows(cars_made, heights, cars.LENGTH / 2 - 0.15, cars.WIDTH / 2 - 0.05, 0.75, 0.02)


def person_shadows(people_made: Instances) -> NDArray[np.float64]:
    """The same for people."""
    heights = 1.7 * people_made["scale"][:, 2]
    level = 0.02 + 0.12 * (people_made["colors"][:, 15] > 0)
    return _shadows(people_made, heights, 0.12, 0.22, 0.45, level)


def _shadows(
    made: Instances, heights: NDArray[np.float64], half_length: float, half_width: float, dark: float,
    level: NDArray[np.float64] | float,
) -> NDArray[np.float64]:  # fmt: skip
    thrown = np.empty((len(made), 8))
    thrown[:, :3] = made["placed"][:, :3]
    thrown[:, 3] = heights
    thrown[:, 4] = half_length * made["scale"][:, 0]
    thrown[:, 5] = half_width * made["scale"][:, 1]
    thrown[:, 6], thrown[:, 7] = dark, level
    return thrown
