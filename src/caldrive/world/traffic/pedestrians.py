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
from caldrive.world.roads.network import SIDEWALK_WIDTH, RoadNetwork

Floats = NDArray[np.float64]
MEAN_WALK_BETWEEN_CROSSINGS = 60.0  # s
WIDEST_CROSSING = 22.0  # m
CORRIDOR = 2.05  # m to either side of a car's middle
PATIENCE = 5.0  # s of waiting at the kerb before walking on, or on the road before turning back
STOPPABLE_SPEED = 9.2  # m/s: from it a full brake stops within the hazard area A2
SEEN_FROM = 8.0  # m ahead of a car's front within which it may begin to brake for them
MAY_GAIN = 3.0  # m/s² by which a moving car may speed up
SPACE_PER_PERSON = 3.0  # m of sidewalk
KERB = 1.2  # m from the middle of the sidewalk
STRIDE = 0.05  # m between the places of a walk that are worked out beforehand


@dataclass(frozen=True)
class Crossing:
    """A way over the road: from a loop at s to another loop at s."""

    loop: int
    s: float
    start: Points
    end: Points
    end_loop: int
    end_s: float

    def back(self) -> Crossing:
        """The same way in the other direction."""
        return Crossing(self.end_loop, self.end_s, self.end, self.start, self.loop, self.s)


@dataclass(frozen=True)
class Walks:
    """Closed loops in the middle of the sidewalks, and the crossings that start on each, ordered by s.

    table: x, y, heading every STRIDE metres of all loops; first: each loop's first row in it.
    """

    crossings: tuple[tuple[Crossing, ...], ...]
    lengths: Floats
    table: Floats
    first: NDArray[np.int64]


@lru_cache(maxsize=8)
def find_walks(roads: RoadNetwork) -> Walks:
    """The sidewalk loops of a town and every metre of kerb where one can cross."""
    middle = roads.roadway.buffer(SIDEWALK_WIDTH / 2)
    parts = middle.geoms if hasattr(middle, "geoms") else [middle]
    rings = [ring.simplify(0.02) for part in parts for ring in (part.exterior, *part.interiors)]
    tables = [_table(np.array(ring.coords)) for ring in rings]
    first = np.cumsum([0, *(len(table) for table in tables[:-1])])
    shapely.prepare(middle)
    crossings = tuple(_crossings(i, table, rings, middle) for i, table in enumerate(tables))
    return Walks(crossings, np.array([ring.length for ring in rings]), np.concatenate(tables), first)


def _table(ring: Points) -> Floats:
    """x, y, heading every STRIDE metres of a closed line."""
    steps = np.diff(ring, axis=0)
    s = np.concatenate(([0.0], np.cumsum(np.linalg.norm(steps, axis=1))))
    at = np.arange(0.0, s[-1] + STRIDE, STRIDE)
    turns = np.unwrap(np.arctan2(steps[:, 1], steps[:, 0]))
    middles = (s[1:] + s[:-1]) / 2
    return np.stack([np.interp(at, s, ring[:, 0]), np.interp(at, s, ring[:, 1]), np.interp(at, middles, turns)], axis=1)


def _crossings(
    i: int, table: Floats, rings: list[shapely.LinearRing], middle: shapely.Geometry
) -> tuple[Crossing, ...]:
    """Straight over the road every 2 m: towards the inside of the road area, up to the next loop."""
    rows = np.arange(int(1.0 / STRIDE), len(table) - int(1.0 / STRIDE), int(2.0 / STRIDE))
    here, heading = table[rows, :2], table[rows, 2]
    sideways = np.stack((-np.sin(heading), np.cos(heading)), axis=1)
    inwards = np.where(shapely.contains_xy(middle, here + 0.3 * sideways)[:, None], sideways, -sideways)
    reach = np.arange(0.3, WIDEST_CROSSING, 0.5)
    beams = here[:, None] + reach[:, None] * inwards[:, None]
    inside = shapely.contains_xy(middle, beams.reshape(-1, 2)).reshape(beams.shape[:2])
    last = np.argmin(inside, axis=1) - 1  # the first place beyond the far loop, and one back
    good = ~inside.all(1) & (reach[last] > 5)
    ends = shapely.points(beams[np.arange(len(last)), last][good])
    loop = np.argmin([shapely.distance(ring, ends) for ring in rings], axis=0)
    s = [rings[k].project(end) for k, end in zip(loop, ends, strict=True)]
    at = np.array([rings[k].interpolate(there).coords[0] for k, there in zip(loop, s, strict=True)]).reshape(-1, 2)
    return tuple(
        Crossing(i, float(row * STRIDE), start, end, int(k), float(there))
        for row, start, end, k, there in zip(rows[good], here[good], at, loop, s, strict=True)
    )


def room(roads: RoadNetwork) -> int:
    """How many people a town's sidewalks hold."""
    return int(find_walks(roads).lengths.sum() / SPACE_PER_PERSON)


def require_room(roads: RoadNetwork, n: int) -> None:
    """Raises ValueError for more people than there is room for."""
    if n > room(roads):
        raise ValueError(
            f"found {n} people asked for, but {roads.name} has room for {room(roads)}: ask for fewer with --people"
        )


class Pedestrians:
    """n people, all random choices from one generator. Raises ValueError for more people than sidewalks hold."""

    def __init__(self, roads: RoadNetwork, n: int, rng: np.random.Generator, crossing: float = 1.0) -> None:
        self.walks, self.rng, self.rate = find_walks(roads), rng, crossing / MEAN_WALK_BETWEEN_CROSSINGS
        lengths = self.walks.lengths
        require_room(roads, n)
        self.n = n
        self.names = [f"person{k}" for k in range(n)]
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
        crossing = np.array([way is not None for way in self.crossing], dtype=bool)
        who = np.flatnonzero(crossing)
        if len(who):
            self._cross(who, dt, cars)
        walk = np.flatnonzero(~crossing)
        self.s[walk] = (self.s[walk] + self.way[walk] * self.pace[walk] * dt) % self.walks.lengths[self.loop[walk]]
        self.walking[walk] = True
        self._place(walk)
        for k in np.flatnonzero(starts & ~crossing):
            self._start_crossing(int(k))

    def _start_crossing(self, k: int) -> None:
        options = self.walks.crossings[self.loop[k]]
        near = next((c for c in options if abs(c.s - self.s[k]) < 1.5), None)
        if near is not None:
            self.crossing[k], self.waited[k] = near, 0.0

    def _cross(self, who: NDArray[np.int64], dt: float, cars: list[VehicleState]) -> None:
        """Those who cross go on, wait for a car, arrive, or lose patience at the kerb."""
        ways = [way for way in (self.crossing[k] for k in who) if way is not None]
        start, end = np.array([way.start for way in ways]), np.array([way.end for way in ways])
        gap = end - self.position[who]
        rest = np.hypot(*gap.T)
        ahead = gap / np.maximum(rest, 1e-9)[:, None]
        step = self.pace[who] * dt
        # At the kerb they look over the whole road, on it only at the next step.
        at_kerb = np.hypot(*(self.position[who] - start).T) < KERB
        look = np.where(at_kerb, rest, step)
        go = may_walk(self.position[who], ahead * look[:, None], self.pace[who], cars)
        self.walking[who], self.heading[who] = go, np.arctan2(ahead[:, 1], ahead[:, 0])
        self.position[who] += np.where(go, np.minimum(step, rest), 0.0)[:, None] * ahead
        done = np.hypot(*(self.position[who] - start).T)
        self.on_road[who] = np.minimum(done, rest) > SIDEWALK_WIDTH / 2
        self.waited[who] = np.where(go, 0.0, self.waited[who] + dt)
        for k, way, arrived, kerb in zip(who.tolist(), ways, rest <= step, at_kerb, strict=True):
            if arrived:
                self._arrive(k, way)
            elif self.waited[k] > PATIENCE:
                self.crossing[k], self.waited[k] = None if kerb else way.back(), 0.0

    def _arrive(self, k: int, way: Crossing) -> None:
        self.loop[k], self.s[k], self.aside[k], self.crossing[k] = way.end_loop, way.end_s, 0.0, None
        self.way[k] = self.rng.choice([-1.0, 1.0])
        self.on_road[k] = False
        self._place(np.array([k]))

    def states(self) -> tuple[PedestrianState, ...]:
        """Everybody as of now."""
        speed = np.where(self.walking, self.pace, 0.0)
        rows = np.column_stack((self.position, self.heading, speed, self.on_road)).tolist()
        return tuple(
            PedestrianState(Pose(x, y, heading), pace, on_road=road > 0, id=name)
            for (x, y, heading, pace, road), name in zip(rows, self.names, strict=True)
        )


def may_walk(position: Points, way: Points, pace: Floats, cars: list[VehicleState]) -> NDArray[np.bool_]:
    """Who of N people (N, 2) may walk a stretch (N, 2) at their pace (N,): who enters no corridor of a car that by then
    is beside them or can neither stop nor pass."""
    at = np.array([(c.pose.x, c.pose.y) for c in cars]).reshape(-1, 2)
    heading, speed, half = np.array([(c.pose.heading, c.speed, c.length / 2) for c in cars]).reshape(-1, 3).T
    u, v = np.cos(heading), np.sin(heading)
    d = position[:, None] - at
    ahead, left = d[..., 0] * u + d[..., 1] * v - half, d[..., 1] * u - d[..., 0] * v
    sideways = way[:, :1] * -v + way[:, 1:] * u  # how far the stretch goes across each car's corridor
    share = np.where(np.abs(sideways) > 1e-6, (np.abs(left) - CORRIDOR) / np.maximum(np.abs(sideways), 1e-6), np.inf)
    entering = (share > 0) & (share <= 1) & (left * sideways < 0)
    moving = speed > 0.3
    with np.errstate(invalid="ignore"):  # who stands still and crosses nothing: infinity times 0, which enters nothing
        arrives = share * np.hypot(*way.T)[:, None] / pace[:, None]
        then = ahead + share * (way[:, :1] * u + way[:, 1:] * v) - speed * arrives
        gained = np.where(moving, MAY_GAIN, 0.0) * arrives  # they reckon with a car that speeds up
        nearest, fastest = then - gained * arrives / 2, speed + gained
        room = np.where(fastest > STOPPABLE_SPEED, fastest * 4.5, 3.5 + fastest * 0.5 + fastest**2 / 10)
        # Until it sees them a car may speed up further: is it too fast by then, and there before they have left?
        unseen, taken = np.maximum(nearest - SEEN_FROM, 0.0), 2 * CORRIDOR / pace[:, None]
        too_fast = fastest**2 + 2 * MAY_GAIN * unseen > STOPPABLE_SPEED**2
        surprised = moving & too_fast & (unseen < fastest * taken + MAY_GAIN * taken**2 / 2)
        blocked = (then > -2 * half - 1.0) & ((nearest < np.where(moving, room, 0.8)) | surprised)
    free: NDArray[np.bool_] = ~(entering & blocked).any(1)
    return free
