"""When which traffic light is green: one approach of a junction at a time, and only while somebody waits there.

One approach at a time, as in CARLA, needs no yielding to oncoming traffic, which nobody who drives by the six
affordances could do. The lights are actuated (loops in the road before the stop line) because the protocol's time limit
leaves a lawful driver of a short route room for one wait only.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from caldrive.datatypes import LightState, Points, Pose, TrafficLight, VehicleState
from caldrive.geometry import to_local
from caldrive.world.roads import LightPost, RoadNetwork

SHORTEST_GREEN, LONGEST_GREEN = 4.0, 7.0  # s
YELLOW = 4.0  # s: a car that starts to brake for it and loses sight of it in A1 still gets through
SHORTEST_CLEARING, LONGEST_CLEARING = 1.0, 6.0  # s with all lights red, until nobody is left inside the junction
LOOP = 16.0  # m before the stop line where somebody who waits is noticed


@dataclass(frozen=True)
class Phase:
    """Which approach has its turn, what it shows, and since when (s)."""

    approach: int
    state: LightState
    since: float


def next_phase(phase: Phase, time: float, waiting: list[bool], occupied: bool) -> Phase:
    """The phase after a look at who waits at which approach, and whether the junction is occupied."""
    lasted = time - phase.since
    others = [k for k in _order_after(phase.approach, len(waiting)) if waiting[k]]
    if phase.state is LightState.GREEN:
        enough = LONGEST_GREEN if waiting[phase.approach] else SHORTEST_GREEN
        return Phase(phase.approach, LightState.YELLOW, time) if others and lasted >= enough else phase
    if phase.state is LightState.YELLOW:
        return Phase(phase.approach, LightState.RED, time) if lasted >= YELLOW else phase
    cleared = lasted >= (LONGEST_CLEARING if occupied else SHORTEST_CLEARING)
    if not cleared:
        return phase
    return Phase(others[0] if others else phase.approach, LightState.GREEN, time)


def _order_after(k: int, n: int) -> list[int]:
    return [(k + i) % n for i in range(1, n)]


class Junction:
    """The lights of one junction. posts: its approaches in the order of their turns."""

    def __init__(self, posts: tuple[LightPost, ...], phase: Phase) -> None:
        self.posts, self.phase = posts, phase
        stops = np.array([np.mean(post.stop_line, axis=0) for post in posts])
        self.center: Points = stops.mean(0)
        self.radius = float(np.linalg.norm(stops - self.center, axis=1).max())
        self.stops = [replace(post.pose, x=float(x), y=float(y)) for post, (x, y) in zip(posts, stops, strict=True)]

    def step(self, time: float, at: Points, headings: Points) -> None:
        """Looks at the cars (centres and headings) and moves on to the next phase if it is time."""
        away = np.hypot(*(at - self.center).T)
        near = away < self.radius + LOOP + 6.0
        waiting = [self._waits(stop, at[near], headings[near]) for stop in self.stops]
        occupied = bool((away < self.radius - 4.0).any())
        self.phase = next_phase(self.phase, time, waiting, occupied)

    @staticmethod
    def _waits(stop: Pose, at: Points, headings: Points) -> bool:
        local = to_local(stop, at)
        same_way = np.cos(headings - stop.heading) > 0.7
        return bool(((local[:, 0] > -LOOP - 2.0) & (local[:, 0] < 0.5) & (np.abs(local[:, 1]) < 2.0) & same_way).any())

    def states(self) -> list[LightState]:
        """What each post shows."""
        return [self.phase.state if i == self.phase.approach else LightState.RED for i in range(len(self.posts))]


class Lights:
    """All traffic lights of a town; who has the first green is drawn from rng."""

    def __init__(self, roads: RoadNetwork, rng: np.random.Generator) -> None:
        grouped: dict[str, list[LightPost]] = defaultdict(list)
        for post in roads.posts:
            grouped[post.light].append(post)
        self.junctions = {
            name: Junction(tuple(posts), Phase(int(rng.integers(len(posts))), LightState.GREEN, -float(rng.uniform(0, 4))))
            for name, posts in sorted(grouped.items())
        }

    def step(self, time: float, cars: Iterable[VehicleState]) -> None:
        """Moves all junctions on to a time (s), given everybody who drives."""
        poses = np.array([(c.pose.x, c.pose.y, c.pose.heading) for c in cars])
        for junction in self.junctions.values():
            junction.step(time, poses[:, :2], poses[:, 2])

    def shown(self) -> tuple[TrafficLight, ...]:
        """Every light with what it shows."""
        return tuple(
            TrafficLight(post.id, post.pose, state, post.stop_line)
            for junction in self.junctions.values()
            for post, state in zip(junction.posts, junction.states(), strict=True)
        )
