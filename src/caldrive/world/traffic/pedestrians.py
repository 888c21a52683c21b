"""People who walk along the sidewalks and cross the road anywhere.

Everybody walks on closed loops in the middle of the sidewalks. Now and then somebody crosses to the loop on the other
side: the careful when the gap between the cars allows it, the bold in front of the ego, walking or running, and some of
them from behind a tree or a car that is parked.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from caldrive.compiled import compiled, inlined
from caldrive.datatypes import PedestrianState, Points, Pose
from caldrive.geometry import boxes_of
from caldrive.world.roads.network import SIDEWALK_WIDTH, RoadNetwork
from caldrive.world.traffic.gap_acceptance import Cars, bumps, foreseen, is_clear, may_walk, watched
from caldrive.world.traffic.sidewalks import Crossing, Floats, Loops, find_sidewalks, require_room

MEAN_WALK_BETWEEN_CROSSINGS = 16.0  # s
# Shares: of those who cross; of the bold, who run, and who come from behind something.
BOLD, RUNNING, HIDDEN = 0.6, 0.3, 0.4
SLOWEST_RUN, FASTEST_RUN = 2.2, 3.2  # m/s
SCREEN = 2.5  # m around a place ahead of the kerb within which a tree or car hides who comes from there
SLOWEST, FASTEST = 0.9, 1.6  # m/s
WIDEST_OFFSET = 0.7  # m from the middle of the sidewalk that somebody walks beside it
CROSSING_REACH = 1.5  # m along the loop within which a crossing is taken
PATIENCE = 5.0  # s of waiting at the kerb before walking on, or on the road before turning back
KERB = 1.2  # m from the middle of the sidewalk
NO_WAY = 1e-9  # m: as good as there
Flags = NDArray[np.bool_]
Along = tuple[list[float], list[Crossing]]  # where crossings from a sidewalk begin, m along it, and these
NO_SCREENS = np.zeros((0, 2))


class Walkers(NamedTuple):
    """N people."""

    loop: NDArray[np.int64]
    """(N,): the sidewalk that each walks on."""
    s: Floats
    """(N,): m along it."""
    direction: Floats
    """(N,): 1 along it, -1 against it."""
    pace: Floats
    """(N,) in m/s."""
    offset: Floats
    """(N,): m to the left of it."""
    position: Points
    """(N, 2) in m."""
    heading: Floats
    """(N,) in rad."""
    walking: Flags
    """(N,): not standing."""
    on_road: Flags
    """(N,)."""
    waited: Floats
    """(N,) in s."""
    bold: Flags
    """(N,): who cross in front of the ego."""
    crossing_pace: Floats
    """(N,) in m/s: with which they cross."""
    start: Points
    """(N, 2): of those who cross, where from."""
    end: Points
    """(N, 2): where to."""


class Pedestrians:
    """n people, all random choices from one generator. crossing: how many times as often as usual they cross; screens:
    what may hide somebody (M, 2), m.

    Raises ValueError for more people than the sidewalks hold.
    """

    def __init__(
        self,
        roads: RoadNetwork,
        n: int,
        rng: np.random.Generator,
        crossing: float = 1.0,
        screens: Points = NO_SCREENS,
    ) -> None:
        require_room(roads, n)
        self.sidewalks, self.rng, self.rate = find_sidewalks(roads), rng, crossing / MEAN_WALK_BETWEEN_CROSSINGS
        lengths = self.sidewalks.loops.lengths
        self.n, self.names = n, [f"person{k}" for k in range(n)]
        loop = rng.choice(len(lengths), size=n, p=lengths / lengths.sum())
        self.walkers = Walkers(
            loop=loop,
            s=rng.uniform(0, lengths[loop]) if n else np.zeros(0),
            direction=rng.choice([-1.0, 1.0], size=n),
            pace=rng.uniform(SLOWEST, FASTEST, size=n),
            offset=rng.uniform(-WIDEST_OFFSET, WIDEST_OFFSET, size=n),
            position=np.zeros((n, 2)), heading=np.zeros(n), walking=np.ones(n, dtype=bool),
            on_road=np.zeros(n, dtype=bool), waited=np.zeros(n), bold=np.zeros(n, dtype=bool),
            crossing_pace=np.zeros(n), start=np.zeros((n, 2)), end=np.zeros((n, 2)),
        )  # fmt: skip
        self.crossing: list[Crossing | None] = [None] * n
        self._crosses = np.zeros(n, dtype=bool)  # who has one
        everywhere = self.sidewalks.crossings if n else []
        self._ways = [_along(ways) for ways in everywhere]
        self._screened = [_along(_screened(ways, screens)) for ways in everywhere]
        self._cars = Cars(boxes_of(()))
        self._path = 0.0  # 1/m: the curvature of the ego's path lately
        self._hiding: set[int] = set()  # those who look for something to come from behind
        walk_on(self.walkers, self.sidewalks.loops, np.arange(n), dt=0.0)

    def step(self, dt: float, cars: Floats, curvature: float = 0.0) -> None:
        """Everybody walks on for dt seconds. cars: see `geometry.boxes_of`, the ego first; curvature: of its path,
        1/m."""
        self._cars = Cars(cars, *foreseen(self._path, curvature))
        self._path = watched(self._path, curvature, dt)
        starts, crossing = self.rng.random(self.n) < self.rate * dt, self._crosses.copy()
        who = np.flatnonzero(crossing)
        if len(who):
            arrived, kerb = np.zeros(len(who), np.bool_), np.zeros(len(who), np.bool_)
            cross_on(self.walkers, who, dt, self._cars, arrived, kerb)
            for k, is_there, at_kerb in zip(who.tolist(), arrived.tolist(), kerb.tolist(), strict=True):
                self._end_crossing(k, is_there, at_kerb)
        walk_on(self.walkers, self.sidewalks.loops, np.flatnonzero(~crossing), dt)
        for k in np.flatnonzero(starts & ~crossing).tolist():
            self._decide(k)
        for k in sorted(self._hiding):
            self._look_for_a_way(k, self._screened)

    def _decide(self, k: int) -> None:
        """Somebody wants to cross from now on, in a way that is drawn."""
        walkers = self.walkers
        bold, running, hidden = self.rng.random(3) < (BOLD, RUNNING, HIDDEN)
        run = self.rng.uniform(SLOWEST_RUN, FASTEST_RUN)
        walkers.bold[k] = bold
        walkers.crossing_pace[k] = run if bold and running else walkers.pace[k]
        if bold and hidden:
            self._hiding.add(k)
        else:
            self._hiding.discard(k)
            self._look_for_a_way(k, self._ways)

    def _look_for_a_way(self, k: int, ways: Sequence[Along]) -> None:
        """Somebody crosses if one of these ways begins here, and no car stands in it."""
        along, crossings = ways[self.walkers.loop[k]]
        s = self.walkers.s[k]
        near = bisect_right(along, s - CROSSING_REACH)
        is_here = near < len(along) and along[near] < s + CROSSING_REACH
        if is_here and is_clear(self.walkers.position[k], crossings[near].end, self._cars):
            self._hiding.discard(k)
            self._take(k, crossings[near])

    def _take(self, k: int, way: Crossing | None) -> None:
        """Somebody crosses on a way from now on, or on none."""
        self.crossing[k], self._crosses[k], self.walkers.waited[k] = way, way is not None, 0.0
        if way is not None:
            self.walkers.start[k], self.walkers.end[k] = way.start, way.end

    def _end_crossing(self, k: int, arrived: bool, at_kerb: bool) -> None:
        """Who crosses may arrive, or lose patience: at the kerb they walk on, on the road they turn back."""
        way, walkers = self.crossing[k], self.walkers
        assert way is not None
        if arrived:
            self._take(k, None)
            walkers.loop[k], walkers.s[k], walkers.offset[k], walkers.on_road[k] = way.end_loop, way.end_s, 0.0, False
            walkers.direction[k] = self.rng.choice([-1.0, 1.0])
            walk_on(walkers, self.sidewalks.loops, np.array([k]), dt=0.0)
        elif walkers.waited[k] > PATIENCE:
            self._take(k, None if at_kerb else way.back())

    def states(self) -> tuple[PedestrianState, ...]:
        """Everybody as of now."""
        walkers = self.walkers
        pace = np.where(self._crosses, walkers.crossing_pace, walkers.pace)
        speeds = np.where(walkers.walking, pace, 0.0).tolist()
        numbers = walkers.position.tolist(), walkers.heading.tolist(), speeds, walkers.on_road.tolist(), self.names
        return tuple(
            PedestrianState(Pose(x, y, heading), speed, on_road=on_road, id=name)
            for (x, y), heading, speed, on_road, name in zip(*numbers, strict=True)
        )


def _along(ways: Sequence[Crossing]) -> Along:
    ordered = sorted(ways, key=lambda way: way.s)
    return [way.s for way in ordered], ordered


def _screened(ways: Sequence[Crossing], screens: Points) -> list[Crossing]:
    """Those that begin behind something."""
    if not ways or not len(screens):
        return []
    starts, ends = (np.array([getattr(way, name) for way in ways]) for name in ("start", "end"))
    ahead = starts + (ends - starts) / np.linalg.norm(ends - starts, axis=1, keepdims=True)
    near = KDTree(screens).query(ahead)[0] < SCREEN
    return [way for way, hides in zip(ways, near, strict=True) if hides]


@compiled
def walk_on(walkers: Walkers, loops: Loops, who: NDArray[np.int64], dt: float) -> None:
    """Some people walk on along their loops for dt seconds."""
    for k in who:
        loop, length = walkers.loop[k], loops.lengths[walkers.loop[k]]
        walkers.s[k] = (walkers.s[k] + walkers.direction[k] * walkers.pace[k] * dt) % length
        row = loops.table[loops.first[loop] + int(walkers.s[k] / loops.grain)]
        walkers.position[k, 0] = row[0] - math.sin(row[2]) * walkers.offset[k]
        walkers.position[k, 1] = row[1] + math.cos(row[2]) * walkers.offset[k]
        walkers.heading[k] = row[2] + (0.0 if walkers.direction[k] > 0 else math.pi)
        walkers.walking[k] = True


@compiled
def cross_on(walkers: Walkers, who: NDArray[np.int64], dt: float, cars: Cars, arrived: Flags, at_kerb: Flags) -> None:
    """Those who cross go on for dt seconds, or wait for a car. Writes who arrives, and who is still at the kerb (len
    (who),)."""
    for i in range(len(who)):
        k = who[i]
        position, pace, is_bold = walkers.position[k], walkers.crossing_pace[k], walkers.bold[k]
        rest, step = _away(position, walkers.end[k]), pace * dt
        ahead_x = (walkers.end[k, 0] - position[0]) / max(rest, NO_WAY)
        ahead_y = (walkers.end[k, 1] - position[1]) / max(rest, NO_WAY)
        at_kerb[i] = _away(position, walkers.start[k]) < KERB
        # At the kerb the careful look over the whole road, on it only at the next step.
        look = rest if at_kerb[i] and not is_bold else step
        arrived[i] = rest <= step
        walkers.heading[k] = math.atan2(ahead_y, ahead_x)
        walkers.walking[k] = may_walk(position, (ahead_x * look, ahead_y * look), pace, cars, is_bold)
        walkers.walking[k] &= not bumps(position, (ahead_x * step, ahead_y * step), cars)
        if walkers.walking[k]:
            position[0] += min(step, rest) * ahead_x
            position[1] += min(step, rest) * ahead_y
        done = _away(position, walkers.start[k])
        walkers.on_road[k] = min(done, rest) > SIDEWALK_WIDTH / 2
        walkers.waited[k] = 0.0 if walkers.walking[k] else walkers.waited[k] + dt


@inlined
def _away(place: Points, other: Points) -> float:
    """m from one place (2,) to another."""
    return math.hypot(other[0] - place[0], other[1] - place[1])
