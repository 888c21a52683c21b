"""Cars and people as instances: what each looks like follows from its id, where it stands from its state."""

from __future__ import annotations

import math
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from caldrive.datatypes import PedestrianState, VehicleState
from caldrive.world.scene import cars, people
from caldrive.world.scene.ground import KERB_HEIGHT

# placed: x, y, heading, phase of the gait (rad). scale: along, across, up, swing of the limbs (rad). colors: of slots 1
# to 4, and in the last byte whether it stands on the sidewalk.
INSTANCE = np.dtype([("placed", "4f4"), ("scale", "4f4"), ("colors", "u1", (4, 4))])

Instances = NDArray[np.void]  # (N,) of INSTANCE
STRIDE = 0.75  # m of one step
SWING = 0.30  # rad of the limbs at 1 m/s
FASTEST_SWING = 1.6  # m/s from which on limbs swing no wider
STANDS = 0.3  # m/s below which the brake lamps are lit
_PAINTS, _UPPERS, _TROUSERS, _SKINS, _HAIRS = (
    np.array(colors, np.uint8) for colors in (cars.PAINTS, people.UPPERS, people.TROUSERS, people.SKINS, people.HAIRS)
)
_CAR_HEIGHTS = np.array([shape.height for shape in cars.SHAPES])


@dataclass(frozen=True)
class Actors:
    """N cars or people."""

    instances: Instances
    shapes: NDArray[np.int64]
    """(N,): which mesh each takes."""
    shadows: NDArray[np.float32]
    """(N, 8): x, y, heading, height, half length, half width (m), darkness underneath, height of the ground."""

    @property
    def at(self) -> NDArray[np.float32]:
        """Positions (N, 2), m."""
        return self.shadows[:, :2]


def _seeds(ids: tuple[str, ...]) -> NDArray[np.int64]:
    """A number (N,) for each id, from which its looks follow."""
    return np.array([zlib.crc32(id.encode()) >> 3 for id in ids], dtype=np.int64)


@lru_cache(maxsize=32)
def _car_templates(ids: tuple[str, ...]) -> tuple[NDArray[np.int64], Instances]:
    """Shapes, and instances with the colours filled in."""
    seeds, instances = _seeds(ids), np.zeros(len(ids), INSTANCE)
    instances["scale"][:, 2] = 1.0
    instances["colors"][:, 0, :3] = _PAINTS[seeds % len(_PAINTS)]
    instances["colors"][:, 2, :3] = cars.HEAD_LAMP
    return seeds // len(_PAINTS) % len(cars.SHAPES), instances


@lru_cache(maxsize=32)
def _person_templates(ids: tuple[str, ...]) -> tuple[NDArray[np.float64], Instances]:
    """Heights over that of the mesh, and instances with the colours filled in."""
    seeds, instances = _seeds(ids), np.zeros(len(ids), INSTANCE)
    for k, palette in enumerate((_UPPERS, _TROUSERS, _SKINS, _HAIRS)):
        instances["colors"][:, k, :3] = palette[seeds // 7**k % len(palette)]
    return people.heights(seeds) / people.HEIGHT, instances


def car_actors(vehicles: Sequence[VehicleState]) -> Actors:
    """Cars; shapes are numbered as in `cars.SHAPES`."""
    shapes, templates = _car_templates(tuple([v.id for v in vehicles]))
    instances, shadows = templates.copy(), np.empty((len(vehicles), 8), np.float32)
    rows = [
        (v.pose.x, v.pose.y, v.pose.heading, v.length / cars.LENGTH, v.width / cars.WIDTH, v.speed) for v in vehicles
    ]
    state = np.array(rows, dtype=np.float32).reshape(-1, 6)
    instances["placed"][:, :3], instances["scale"][:, :2] = state[:, :3], state[:, 3:5]
    instances["colors"][:, 1, :3] = np.where(state[:, 5:] < STANDS, cars.BRAKE_LAMP, cars.TAIL_LAMP)
    shadows[:, :3], shadows[:, 3] = state[:, :3], 0.85 * _CAR_HEIGHTS[shapes]
    shadows[:, 4:6] = state[:, 3:5] * (cars.LENGTH / 2 - 0.15, cars.WIDTH / 2 - 0.05)
    shadows[:, 6:] = 0.75, 0.02
    return Actors(instances, shapes, shadows)


def person_actors(pedestrians: Sequence[PedestrianState]) -> Actors:
    """People. Their steps follow from the way covered, so that no foot slides."""
    height, templates = _person_templates(tuple([p.id for p in pedestrians]))
    instances, shadows = templates.copy(), np.empty((len(pedestrians), 8), np.float32)
    rows = [(p.pose.x, p.pose.y, p.pose.heading, p.speed, not p.on_road) for p in pedestrians]
    state = np.array(rows, dtype=np.float64).reshape(-1, 5)
    x, y, heading, speed, on_sidewalk = state.T
    phase = math.pi / STRIDE * (x * np.cos(heading) + y * np.sin(heading))
    instances["placed"][:, :3], instances["placed"][:, 3] = state[:, :3], np.remainder(phase, math.tau)
    instances["scale"][:, :3] = height[:, None]
    instances["scale"][:, 3] = SWING * np.minimum(speed, FASTEST_SWING)
    instances["colors"][:, 3, 3] = 255 * on_sidewalk
    shadows[:, :3], shadows[:, 3] = state[:, :3], 1.7 * height
    shadows[:, 4:7], shadows[:, 7] = (0.12, 0.22, 0.45), 0.02 + KERB_HEIGHT * on_sidewalk
    return Actors(instances, np.zeros(len(instances), dtype=np.int64), shadows)
