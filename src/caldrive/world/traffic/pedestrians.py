"""People who walk along the sidewalks and cross the road anywhere.

Everybody walks on closed loops in the middle of the sidewalks. Now and then somebody crosses to the loop on the other
side. They accept a gap as people do: they step into a lane where a driver who keeps to the limit can still stop for
them, or has passed, or is slow; in front of a fast car they wait.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from caldrive.datatypes import PedestrianState, Points, Pose, VehicleState
from caldrive.geometry import ahead_and_left, positions
from caldrive.world.roads.network import SIDEWALK_WIDTH, RoadNetwork
from caldrive.world.traffic.sidewalks import Crossing, Floats, find_sidewalks, require_room

MEAN_WALK_BETWEEN_CROSSINGS = 60.0  # s
SLOWEST, FASTEST = 0.9, 1.6  # m/s
WIDEST_OFFSET = 0.7  # m from the middle of the sidewalk that somebody walks beside it
CROSSING_REACH = 1.5  # m along the loop within which a crossing is taken
PATIENCE = 5.0  # s of waiting at the kerb before walking on, or on the road before turning back
KERB = 1.2  # m from the middle of the sidewalk

CORRIDOR = 2.05  # m to either side of a car's middle
STOPPABLE_SPEED = 9.2  # m/s: from it a full brake stops within the hazard area A2
SEEN_FROM = 8.0  # m ahead of a car's front within which it may begin to brake for them
MAY_GAIN = 3.0  # m/s² by which a moving car may speed up
MOVING = 0.3  # m/s from which on a car moves
STANDING_GAP = 0.8  # m ahead of a standing car within which nobody walks
PASSED = 1.0  # m behind a car's rear from which on it has passed


class Pedestrians:
    """n people, all random choices from one generator. crossing: how many times as often as usual they cross.

    Raises ValueError for more people than the sidewalks hold.
    """

    def __init__(self, roads: RoadNetwork, n: int, rng: np.random.Generator, crossing: float = 1.0) -> None:
        require_room(roads, n)
        self.sidewalks, self.rng, self.rate = find_sidewalks(roads), rng, crossing / MEAN_WALK_BETWEEN_CROSSINGS
        lengths = self.sidewalks.lengths
        self.n = n
        self.names = [f"person{k}" for k in range(n)]
        self.loop = rng.choice(len(lengths), size=n, p=lengths / lengths.sum())
        self.s = rng.uniform(0, lengths[self.loop]) if n else np.zeros(0)
        self.direction = rng.choice([-1.0, 1.0], size=n)  # along their loops
        self.pace = rng.uniform(SLOWEST, FASTEST, size=n)  # m/s
        self.offset = rng.uniform(-WIDEST_OFFSET, WIDEST_OFFSET, size=n)  # m to the left of the loop
        self.crossing: list[Crossing | None] = [None] * n
        self.waited = np.zeros(n)  # s
        self.walking = np.ones(n, dtype=bool)
        self.position = np.zeros((n, 2))
        self.heading = np.zeros(n)
        self.on_road = np.zeros(n, dtype=bool)
        self._place(np.arange(n))

    def _place(self, who: NDArray[np.int64]) -> None:
        """Puts those who walk a loop where s says."""
        x, y, heading = self.sidewalks.poses(self.loop[who], self.s[who]).T
        self.position[who, 0] = x - np.sin(heading) * self.offset[who]
        self.position[who, 1] = y + np.cos(heading) * self.offset[who]
        self.heading[who] = heading + np.where(self.direction[who] > 0, 0.0, math.pi)

    def step(self, dt: float, cars: Sequence[VehicleState]) -> None:
        """Everybody walks on for dt seconds."""
        starts = self.rng.random(self.n) < self.rate * dt
        crossing = np.array([way is not None for way in self.crossing], dtype=bool)
        who = np.flatnonzero(crossing)
        if len(who):
            self._cross(who, dt, cars)
        walk = np.flatnonzero(~crossing)
        length = self.sidewalks.lengths[self.loop[walk]]
        self.s[walk] = (self.s[walk] + self.direction[walk] * self.pace[walk] * dt) % length
        self.walking[walk] = True
        self._place(walk)
        for k in np.flatnonzero(starts & ~crossing):
            self._start_crossing(int(k))

    def _start_crossing(self, k: int) -> None:
        options = self.sidewalks.crossings[self.loop[k]]
        near = next((way for way in options if abs(way.s - self.s[k]) < CROSSING_REACH), None)
        if near is not None:
            self.crossing[k], self.waited[k] = near, 0.0

    def _cross(self, who: NDArray[np.int64], dt: float, cars: Sequence[VehicleState]) -> None:
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
        self.loop[k], self.s[k], self.offset[k], self.crossing[k] = way.end_loop, way.end_s, 0.0, None
        self.direction[k] = self.rng.choice([-1.0, 1.0])
        self.on_road[k] = False
        self._place(np.array([k]))

    def states(self) -> tuple[PedestrianState, ...]:
        """Everybody as of now."""
        speed = np.where(self.walking, self.pace, 0.0)
        rows = np.column_stack((self.position, self.heading, speed, self.on_road)).tolist()
        return tuple(
            PedestrianState(Pose(x, y, heading), speed, on_road=on_road > 0, id=name)
            for (x, y, heading, speed, on_road), name in zip(rows, self.names, strict=True)
        )


def may_walk(position: Points, way: Points, pace: Floats, cars: Sequence[VehicleState]) -> NDArray[np.bool_]:
    """Who of N people (N, 2) may walk a stretch (N, 2) at their pace (N,): who enters no corridor of a car that by then
    is beside them or can neither stop nor pass."""
    heading, speed, half = np.array([(c.pose.heading, c.speed, c.length / 2) for c in cars]).reshape(-1, 3).T
    u, v = np.cos(heading), np.sin(heading)
    ahead, left = ahead_and_left(position, positions(cars), heading)
    ahead -= half
    sideways = way[:, :1] * -v + way[:, 1:] * u  # how far the stretch goes across each car's corridor
    share = np.where(np.abs(sideways) > 1e-6, (np.abs(left) - CORRIDOR) / np.maximum(np.abs(sideways), 1e-6), np.inf)
    entering = (share > 0) & (share <= 1) & (left * sideways < 0)
    moving = speed > MOVING
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
        too_near = nearest < np.where(moving, room, STANDING_GAP)
        blocked = (then > -2 * half - PASSED) & (too_near | surprised)
    free: NDArray[np.bool_] = ~(entering & blocked).any(1)
    return free
