"""People who walk along the sidewalks and cross the road anywhere.

Everybody walks on closed loops in the middle of the sidewalks. Now and then somebody crosses to the loop on the other
side. They look before they step into a lane: they go where a driver who keeps to the limit can still stop for them, or
has passed, or is slow; in front of a fast car they wait.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import shapely
from numpy.typing import NDArray

from caldrive.datatypes import PedestrianState, Points, Pose, VehicleState
from caldrive.geometry import Polyline
from caldrive.world.roads import SIDEWALK_WIDTH, RoadNetwork

Floats = NDArray[np.float64]

MEAN_WALK_BETWEEN_CROSSINGS = 60.0  # s
WIDEST_CROSSING = 22.0  # m
CORRIDOR = 2.1  # m to either side of a car's middle
PATIENCE = 8.0  # s of waiting at the kerb before walking on
STOPPABLE_SPEED = 9.2  # m/s: from it a full brake stops within the hazard area A2
SPACE_PER_PERSON = 3.0  # m of sidewalk
STRIDE = 0.05  # m between the places of a walk that are worked out beforehand


@dataclass(frozen=True)
class Crossing:
    """A way over the road: from a loop at s to another loop at s."""

    loop: int
    s: float
    end: Points
    end_loop: int
    end_s: float


@dataclass(frozen=True)
class Walks:
    """Closed loops in the middle of the sidewalks, and the crossings that start on each, ordered by s.

    table: x, y, heading every STRIDE metres of all loops; first: each loop's first row in it.
    """

    loops: tuple[Polyline, ...]
    crossings: tuple[tuple[Crossing, ...], ...]
    lengths: Floats
    table: Floats
    first: NDArray[np.int64]


@lru_cache(maxsize=8)
def find_walks(roads: RoadNetwork) -> Walks:
    """The sidewalk loops of a town and every metre of kerb where one can cross."""
    middle = roads.roadway.buffer(SIDEWALK_WIDTH / 2)
    parts = middle.geoms if hasattr(middle, "geoms") else [middle]
    rings = [ring for part in parts for ring in (part.exterior, *part.interiors)]
    loops = tuple(Polyline(np.array(ring.simplify(0.02).coords)) for ring in rings)
    poses = [[loop.pose_at(s) for s in np.arange(0.0, loop.length + STRIDE, STRIDE)] for loop in loops]
    first = np.cumsum([0, *(len(rows) for rows in poses[:-1])])
    table = np.array([(pose.x, pose.y, pose.heading) for rows in poses for pose in rows])
    crossings = tuple(_crossings(i, loops, middle) for i in range(len(loops)))
    return Walks(loops, crossings, np.array([loop.length for loop in loops]), table, first)


def _crossings(i: int, loops: tuple[Polyline, ...], middle: shapely.Geometry) -> tuple[Crossing, ...]:
    """Straight over the road every 2 m: towards the inside of the road area, up to the next loop."""
    loop, found = loops[i], []
    for s in np.arange(1.0, loop.length - 1.0, 2.0):
        pose = loop.pose_at(s)
        here = np.array([pose.x, pose.y])
        sideways = np.array([-math.sin(pose.heading), math.cos(pose.heading)])
        inwards = sideways if middle.contains(shapely.Point(here + 0.3 * sideways)) else -sideways
        beam = shapely.LineString([here + 0.3 * inwards, here + WIDEST_CROSSING * inwards])
        inside = beam.intersection(middle)
        first = inside.geoms[0] if hasattr(inside, "geoms") else inside
        if first.length < 5 or first.length > WIDEST_CROSSING - 1:
            continue
        end = np.array(first.coords[-1])
        hits = [loop.project(*end) for loop in loops]
        j = int(np.argmin([abs(hit.left) for hit in hits]))
        found.append(Crossing(i, float(s), end, j, hits[j].s))
    return tuple(found)


class Pedestrians:
    """n people, all random choices from one generator. Raises ValueError for more people than sidewalks hold."""

    def __init__(self, roads: RoadNetwork, n: int, rng: np.random.Generator, crossing: float = 1.0) -> None:
        self.walks, self.rng, self.rate = find_walks(roads), rng, crossing / MEAN_WALK_BETWEEN_CROSSINGS
        lengths = self.walks.lengths
        room = int(lengths.sum() / SPACE_PER_PERSON)
        if n > room:
            raise ValueError(f"found {n} people asked for, but {roads.name} has room for {room}: ask for fewer with --people")
        self.n = n
        self.loop = rng.choice(len(lengths), size=n, p=lengths / lengths.sum())
        self.s = rng.uniform(0, lengths[self.loop]) if n else np.zeros(0)
        self.way = rng.choice([-1.0, 1.0], size=n)
        self.pace = rng.uniform(0.9, 1.6, size=n)
        self.aside = rng.uniform(-0.7, 0.7, size=n)
        self.crossing: list[Crossing | None] = [None] * n
        self.waited = np.zeros(n)
        self.walking = np.ones(n, dtype=bool)
        self.position = np.zeros((n, 2))
        self.heading = np.zeros(n)
        self.on_road = np.zeros(n, dtype=bool)
        self._place(np.arange(n))

    def _place(self, who: NDArray[np.int64]) -> None:
        """Puts those who walk a loop where s says."""
        rows = self.walks.first[self.loop[who]] + (self.s[who] / STRIDE).astype(int)
        x, y, heading = self.walks.table[rows].T
        self.position[who, 0] = x - np.sin(heading) * self.aside[who]
        self.position[who, 1] = y + np.cos(heading) * self.aside[who]
        self.heading[who] = heading + np.where(self.way[who] > 0, 0.0, math.pi)

    def step(self, dt: float, cars: list[VehicleState]) -> None:
        """Everybody walks on for dt seconds."""
        starts = self.rng.random(self.n) < self.rate * dt
        view = _View(cars)
        crossing = np.array([way is not None for way in self.crossing], dtype=bool)
        for k in np.flatnonzero(crossing):
            self._cross(int(k), dt, view)
        walk = np.flatnonzero(~crossing)
        self.s[walk] = (self.s[walk] + self.way[walk] * self.pace[walk] * dt) % self.walks.lengths[self.loop[walk]]
        self.walking[walk] = True
        self._place(walk)
        for k in np.flatnonzero(starts & ~crossing):
            self._start_crossing(int(k))

    def _start_crossing(self, k: int) -> None:
        options = self.walks.crossings[self.loop[k]]
        near = [c for c in options if abs(c.s - self.s[k]) < 1.5]
        if near:
            self.crossing[k], self.waited[k] = near[0], 0.0

    def _cross(self, k: int, dt: float, view: _View) -> None:
        way = self.crossing[k]
        assert way is not None
        gap = way.end - self.position[k]
        rest = float(np.linalg.norm(gap))
        ahead = gap / max(rest, 1e-9)
        step = self.pace[k] * dt
        self.walking[k] = view.may_step(self.position[k], ahead, step + 0.25)
        self.heading[k] = math.atan2(ahead[1], ahead[0])
        if rest <= step:
            self._arrive(k, way)
        elif self.walking[k]:
            self.position[k] += ahead * step
            self.on_road[k] = self.on_road[k] or rest < np.linalg.norm(way.end - self._start_of(way)) - SIDEWALK_WIDTH / 2
            self.on_road[k] = self.on_road[k] and rest > SIDEWALK_WIDTH / 2
        elif not self.on_road[k]:
            self.waited[k] += dt
            if self.waited[k] > PATIENCE:
                self.crossing[k] = None

    def _start_of(self, way: Crossing) -> Points:
        pose = self.walks.loops[way.loop].pose_at(way.s)
        return np.array([pose.x, pose.y])

    def _arrive(self, k: int, way: Crossing) -> None:
        self.loop[k], self.s[k], self.aside[k], self.crossing[k] = way.end_loop, way.end_s, 0.0, None
        self.way[k] = self.rng.choice([-1.0, 1.0])
        self.on_road[k] = False
        self._place(np.array([k]))

    def states(self) -> tuple[PedestrianState, ...]:
        """Everybody as of now."""
        return tuple(
            PedestrianState(
                Pose(float(x), float(y), float(h)), float(p) if w else 0.0, on_road=bool(r), id=f"person{k}"
            )
            for k, ((x, y), h, p, w, r) in enumerate(
                zip(self.position, self.heading, self.pace, self.walking, self.on_road, strict=True)
            )
        )


class _View:
    """What a person at the kerb sees of the cars."""

    def __init__(self, cars: list[VehicleState]) -> None:
        self.at = np.array([(c.pose.x, c.pose.y) for c in cars]).reshape(-1, 2)
        headings = np.array([c.pose.heading for c in cars])
        self.forward = np.stack((np.cos(headings), np.sin(headings)), axis=-1)
        self.speed = np.array([c.speed for c in cars])
        self.half = np.array([c.length / 2 for c in cars])

    def may_step(self, position: Points, direction: Points, reach: float) -> bool:
        """Whether the next step enters no corridor of a car that could not stop or pass in time."""
        now, then = self._seen_from_cars(position), self._seen_from_cars(position + direction * reach)
        entering = (np.abs(now[1]) > CORRIDOR) & (np.abs(then[1]) <= CORRIDOR)
        ahead = now[0] - self.half  # metres from the front bumper
        beside = (ahead <= 0.8) & (ahead > -2 * self.half - 1.0)
        room = np.where(self.speed > STOPPABLE_SPEED, self.speed * 4.5, 3.5 + self.speed * 0.5 + self.speed**2 / 10)
        coming = (ahead > 0) & (ahead < room) & (self.speed > 0.3)
        return not bool((entering & (beside | coming)).any())

    def _seen_from_cars(self, point: Points) -> tuple[Floats, Floats]:
        d = point - self.at
        return (
            d[:, 0] * self.forward[:, 0] + d[:, 1] * self.forward[:, 1],
            d[:, 1] * self.forward[:, 0] - d[:, 0] * self.forward[:, 1],
        )
