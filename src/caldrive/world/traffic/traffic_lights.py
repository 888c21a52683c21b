"""When which traffic light is green: one approach of a junction at a time, and only while somebody waits there.

One approach at a time, as in CARLA, needs no yielding to oncoming traffic, which nobody who drives by the six
affordances could do. The lights are actuated (loops in the road before the stop line) because the protocol's time limit
leaves a lawful driver of a short route room for one wait only.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from caldrive.compiled import compiled
from caldrive.datatypes import LightState, Points, TrafficLight
from caldrive.world.roads.network import LightPost, RoadNetwork

SHORTEST_GREEN, LONGEST_GREEN = 3.0, 5.0  # s
YELLOW = 3.5  # s: a car that starts to brake for it and loses sight of it in A1 still gets through
SHORTEST_CLEARING, LONGEST_CLEARING = 1.0, 20.0  # s with all lights red, until nobody is left inside the junction
LOOP = 24.0  # m before the stop line where somebody who waits is noticed
HALF_CAR = 2.0  # m from a car's front to its centre, about
LOOP_HALF_WIDTH = 2.0  # m to either side of the approach
JUST_BEYOND = 0.5  # m past the stop line where somebody still waits
SAME_WAY = 0.7  # cosine of the angle to the approach from which on somebody drives along it
INSIDE = 4.0  # m nearer to the middle than the stop lines: inside the junction


@dataclass(frozen=True)
class Phase:
    """Which approach of a junction has its turn; all others show red."""

    approach: int
    """Its number."""
    state: LightState
    """What it shows."""
    since: float
    """s."""


def next_phase(phase: Phase, time: float, waiting: list[bool], occupied: bool) -> Phase:
    """The phase after a look at who waits at which approach, and whether the junction is occupied; time in s."""
    lasted = time - phase.since
    candidates = [k for k in _order_after(phase.approach, len(waiting)) if waiting[k]]
    if phase.state is LightState.GREEN:
        enough = LONGEST_GREEN if waiting[phase.approach] else SHORTEST_GREEN
        return Phase(phase.approach, LightState.YELLOW, time) if candidates and lasted >= enough else phase
    if phase.state is LightState.YELLOW:
        return Phase(phase.approach, LightState.RED, time) if lasted >= YELLOW else phase
    cleared = lasted >= (LONGEST_CLEARING if occupied else SHORTEST_CLEARING)
    if not cleared:
        return phase
    return Phase(candidates[0] if candidates else phase.approach, LightState.GREEN, time)


def _order_after(k: int, n: int) -> list[int]:
    """The other n - 1 approaches in the order of their turns after k."""
    return [(k + i) % n for i in range(1, n)]


class JunctionLights:
    """The lights of one junction. posts: those of its approaches, in the order of their turns; lanes side by side have
    the same turn."""

    def __init__(self, posts: tuple[LightPost, ...], rng: np.random.Generator) -> None:
        names = list(dict.fromkeys(post.approach for post in posts))
        self.held: dict[int, LightState] = {}
        """What posts are told to show from outside, by their numbers."""
        self.posts, self.approaches = posts, [names.index(post.approach) for post in posts]
        self.change(_first_phase(len(names), rng))

    def change(self, phase: Phase) -> None:
        """Shows a phase; lights stay the same objects as long as it lasts."""
        self.phase = phase
        self.lights = tuple(
            TrafficLight(post.id, post.pose, state, post.stop_line)
            for post, state in zip(self.posts, self.states(), strict=True)
        )

    def states(self) -> list[LightState]:
        """What each post shows."""
        shown = [self.phase.state if k == self.phase.approach else LightState.RED for k in self.approaches]
        return [self.held.get(i, state) for i, state in enumerate(shown)] if self.held else shown

    def hold(self, held: Mapping[int, LightState]) -> None:
        """Shows what somebody wants at some posts, by their numbers, and what is due at the others."""
        self.held = dict(held)
        self.change(replace(self.phase))  # an equal phase, but another: whoever looks for changes sees one

    def waiting(self, at_posts: list[bool]) -> list[bool]:
        """Whether somebody waits in each approach, from whether somebody does at each post."""
        waiting = [False] * (max(self.approaches) + 1)
        for k, waits in zip(self.approaches, at_posts, strict=True):
            waiting[k] |= waits
        return waiting


class Junctions(NamedTuple):
    """Where the junctions with lights are."""

    centers: Points
    """(J, 2)."""
    radii: Points
    """(J,) m from a centre to the farthest stop line."""
    ends: NDArray[np.int64]
    """(J,) behind each one's last post; the posts of a junction follow each other."""
    stops: Points
    """(P, 2) middles of the stop lines."""
    headings: Points
    """(P,) of who drives towards them."""


def _where(junctions: Sequence[JunctionLights]) -> Junctions:
    """Where junctions with lights are; at least one."""
    groups = [np.array([np.mean(post.stop_line, axis=0) for post in junction.posts]) for junction in junctions]
    centers = np.array([stops.mean(0) for stops in groups])
    return Junctions(
        centers=centers,
        radii=np.array([np.linalg.norm(g - c, axis=1).max() for g, c in zip(groups, centers, strict=True)]),
        ends=np.cumsum([len(stops) for stops in groups]),
        stops=np.concatenate(groups),
        headings=np.array([post.pose.heading for junction in junctions for post in junction.posts]),
    )


def _look(boxes: Points, at: Junctions) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Whether somebody waits at each post (P,), and whether each junction is occupied (J,): loops in the road. boxes:
    of cars, see `geometry.boxes_of`."""
    waiting, occupied = np.zeros(len(at.headings), np.bool_), np.zeros(len(at.radii), np.bool_)
    _look_before(boxes, at, waiting)
    _look_inside(boxes, at, occupied)
    return waiting, occupied


@compiled
def _waits(car: Points, stop: Points, heading: float) -> bool:
    """Whether a car (3,) waits at a stop line (2,)."""
    dx, dy = car[0] - stop[0], car[1] - stop[1]
    if max(abs(dx), abs(dy)) > LOOP + HALF_CAR + LOOP_HALF_WIDTH:
        return False
    c, s = math.cos(heading), math.sin(heading)
    ahead, left = dx * c + dy * s, dy * c - dx * s
    near = -LOOP - HALF_CAR < ahead < JUST_BEYOND and abs(left) < LOOP_HALF_WIDTH
    return near and math.cos(car[2] - heading) > SAME_WAY


@compiled
def _look_before(boxes: Points, at: Junctions, waiting: NDArray[np.bool_]) -> None:
    """Writes whether somebody waits at each post (P,)."""
    for post in range(len(at.stops)):
        for k in range(len(boxes)):
            waiting[post] |= _waits(boxes[k], at.stops[post], at.headings[post])


@compiled
def _look_inside(boxes: Points, at: Junctions, occupied: NDArray[np.bool_]) -> None:
    """Writes whether somebody is inside each junction (J,); who waits at one of its stop lines is not, even if others
    lie farther out."""
    first = 0
    for junction in range(len(at.centers)):
        for k in range(len(boxes)):
            away = math.hypot(boxes[k, 0] - at.centers[junction, 0], boxes[k, 1] - at.centers[junction, 1])
            inside = away < at.radii[junction] - INSIDE
            for post in range(first, at.ends[junction]):
                inside = inside and not _waits(boxes[k], at.stops[post], at.headings[post])
            occupied[junction] |= inside
        first = at.ends[junction]


class TrafficLights:
    """All traffic lights of a town; who has the first green is drawn from rng. junctions: by the light's id.

    demand: how often (1/s) somebody comes to each approach whom nobody sees, as where no cars drive the lights would
    wait for the ego alone, and never turn yellow before it.
    """

    def __init__(self, roads: RoadNetwork, rng: np.random.Generator, demand: float = 0.0) -> None:
        grouped: dict[str, list[LightPost]] = defaultdict(list)
        for post in roads.posts:
            grouped[post.light].append(post)
        self.junctions = {name: JunctionLights(tuple(posts), rng) for name, posts in sorted(grouped.items())}
        self._at = _where([*self.junctions.values()]) if self.junctions else None
        self.rng, self.demand, self._time = rng, demand, 0.0
        self.frozen: set[str] = set()
        """Junctions that stay as they are."""
        self._unseen = np.zeros(sum(len(junction.posts) for junction in self.junctions.values()), dtype=bool)

    def step(self, time: float, cars: NDArray[np.float64]) -> None:
        """Moves all junctions on to a time (s). cars: everybody who drives, see `geometry.boxes_of`."""
        if self._at is None:
            return
        waiting, occupied = _look(cars, self._at)
        if self.demand:
            self._unseen |= self.rng.random(len(self._unseen)) < self.demand * (time - self._time)
            self._unseen &= ~np.array([state is LightState.GREEN for state in self._shown()], dtype=bool)
            waiting |= self._unseen
        self._time = time
        first, waits = 0, waiting.tolist()
        for (name, junction), busy in zip(self.junctions.items(), occupied.tolist(), strict=True):
            last = first + len(junction.posts)
            phase = next_phase(junction.phase, time, junction.waiting(waits[first:last]), busy)
            if phase is not junction.phase and name not in self.frozen:
                junction.change(phase)
            first = last

    def _shown(self) -> list[LightState]:
        """What each post shows."""
        return [light.state for light in self.states()]

    def states(self) -> tuple[TrafficLight, ...]:
        """Every light with what it shows now."""
        return tuple(light for junction in self.junctions.values() for light in junction.lights)


def _first_phase(n: int, rng: np.random.Generator) -> Phase:
    """Green for one of n approaches, for some seconds already."""
    return Phase(int(rng.integers(n)), LightState.GREEN, since=-float(rng.uniform(0, 4)))
