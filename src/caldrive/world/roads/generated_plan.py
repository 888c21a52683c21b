"""Plans drawn at random: a grid of crossings, pushed about, with streets missing, others curved, and roundabouts."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import networkx as nx
import numpy as np
import shapely

from caldrive.datatypes import Points
from caldrive.world.roads.generated_config import GeneratedTownConfig
from caldrive.world.roads.plans import Plan, Roundabout, Street

NEARLY_STRAIGHT = 0.2  # rad that a street may turn at a crossing to be drawn straight past it
LEAST_ANGLE, LEAST_RING_ANGLE = math.radians(55), math.radians(70)  # between two streets at a junction, a roundabout
TANGENT_SHARE = 0.42  # of a stretch between two corners, that the rounding of one may take
LEAST_CURVED, MOST_BOW = 70.0, 14.0  # m: shorter streets do not curve, and none leaves the straight line further
LEAST_JUNCTIONS = 6
TO_BOTH_SIDES = 1 / 3  # of the curved streets
GRAIN = 2.0  # m from one point of a bend to the next
LEAST_APART = 28.0  # m between streets that do not meet
LEAST_ARM = 45.0  # m of every street that meets a roundabout
RING_ARMS = 4  # with fewer, the middle of the stop lines, around which the lights look for cars, is not the ring's


@dataclass(frozen=True, eq=False)
class _Way:
    """A street before its corners are rounded. line: (N, 2), from junction to junction."""

    start: str
    end: str
    line: Points
    lanes: int

    def arm(self, junction: str) -> Points:
        """The way as seen from one of its ends."""
        return self.line if junction == self.start else self.line[::-1]

    def moved(self, junction: str, name: str, place: tuple[float, float]) -> _Way:
        """With one lane a side, and one end moved to another junction."""
        line = self.line.copy()
        line[0 if junction == self.start else -1] = place
        start, end = (name if end == junction else end for end in (self.start, self.end))
        return _Way(start, end, line, lanes=1)

    def street(self, radius: float) -> Street:
        """With corners rounded by a radius in m, or by less where there is less room."""
        corners = tuple((float(x), float(y)) for x, y in self.line[1:-1])
        return Street(self.start, self.end, corners, round(min([radius, *_radii(self.line)]), 2), self.lanes)


def draw_plan(name: str, config: GeneratedTownConfig, rng: np.random.Generator) -> Plan | None:
    """A random plan, or None where what was drawn makes no town."""
    grid = _thinned_grid(config, rng)
    places = _crossings(grid, config, rng)
    names = {crossing: f"{chr(ord('A') + crossing[0])}{crossing[1]}" for crossing in grid if grid.degree[crossing] > 2}
    junctions = {names[crossing]: places[crossing] for crossing in names}
    share = rng.uniform(*config.curved)
    ways = [
        _Way(names[way[0]], names[way[-1]], _line([places[c] for c in way], share, config, rng), config.lanes)
        for way in _between_junctions(grid, names)
    ]
    if not _is_town(junctions, ways):
        return None
    if config.lanes > 1:
        share = rng.uniform(*config.narrow)
        ways = [replace(way, lanes=1 if rng.random() < share else config.lanes) for way in ways]
    lane_width, radius = round(rng.uniform(*config.lane_width), 2), rng.uniform(*config.corner_radius)
    rings = _draw_roundabouts(junctions, ways, config, rng)
    if len(rings) < config.roundabouts[0]:
        return None
    streets = tuple(way.street(radius) for way in ways)
    unlit = _draw_unlit(junctions, rings, config, rng)
    return Plan(name, junctions, streets, lane_width, grain=GRAIN, roundabouts=tuple(rings), unlit=unlit)


def _thinned_grid(config: GeneratedTownConfig, rng: np.random.Generator) -> nx.Graph:
    """A grid without some of its stretches, in which every stretch still lies on a way round."""
    columns, rows = (int(rng.integers(least, most + 1)) for least, most in (config.columns, config.rows))
    grid = nx.grid_2d_graph(columns, rows)
    left_out = round(rng.uniform(*config.missing) * grid.number_of_edges())
    edges = list(grid.edges)
    for k in rng.permutation(len(edges)):
        if left_out == 0:
            break
        grid.remove_edge(*edges[k])
        is_dead_end = any(grid.degree[crossing] < 2 for crossing in edges[k])
        if not is_dead_end and nx.is_connected(grid) and not nx.has_bridges(grid):
            left_out -= 1
        else:
            grid.add_edge(*edges[k])
    return grid


def _crossings(
    grid: nx.Graph, config: GeneratedTownConfig, rng: np.random.Generator
) -> dict[tuple[int, int], tuple[float, float]]:
    """Where the crossings of a grid lie, m."""
    columns, rows = (1 + max(crossing[axis] for crossing in grid) for axis in (0, 1))
    x, y = (np.cumsum([0.0, *rng.uniform(*config.spacing, n - 1)]) for n in (columns, rows))
    off = rng.uniform(-config.jitter, config.jitter, (columns, rows, 2))
    return {
        (i, j): (round(float(x[i] + off[i, j, 0]), 2), round(float(y[j] + off[i, j, 1]), 2))
        for i in range(columns)
        for j in range(rows)
    }


def _between_junctions(grid: nx.Graph, junctions: Mapping[tuple[int, int], str]) -> Iterator[list[tuple[int, int]]]:
    """The crossings along each street: from a junction over bends to the next junction."""
    seen = set[frozenset[tuple[int, int]]]()
    for first in junctions:
        for second in grid.neighbors(first):
            way = [first, second]
            while way[-1] not in junctions:
                way.append(next(crossing for crossing in grid.neighbors(way[-1]) if crossing != way[-2]))
            if frozenset(way[:2]) not in seen:
                seen.update((frozenset(way[:2]), frozenset(way[-2:])))
                yield way


def _line(
    places: Sequence[tuple[float, float]], share: float, config: GeneratedTownConfig, rng: np.random.Generator
) -> Points:
    """The line of a street over some crossings; a share of those that are straight curve to a side, or to both."""
    line = np.array(places)
    turns = np.abs(_turns(line))
    line = line[np.concatenate(([True], turns > NEARLY_STRAIGHT, [True]))]
    along = line[-1] - line[0]
    length, chance = float(np.hypot(*along)), rng.random()
    bow = min(rng.uniform(*config.bow) * length, MOST_BOW) * rng.choice([-1.0, 1.0])
    if len(line) > 2 or length < LEAST_CURVED or chance >= share:
        return line
    left = np.array([-along[1], along[0]]) / length
    bulges = [(1 / 3, bow / 2), (2 / 3, -bow / 2)] if chance < share * TO_BOTH_SIDES else [(1 / 2, bow)]
    corners = [line[0] + forward * along + aside * left for forward, aside in bulges]
    return np.array([line[0], *corners, line[1]])


def _turns(line: Points) -> Points:
    """How far a line turns at each of its corners (N,), rad."""
    steps = np.diff(line, axis=0)
    headings = np.arctan2(steps[:, 1], steps[:, 0])
    return np.asarray((np.diff(headings) + math.pi) % math.tau - math.pi)


def _radii(line: Points) -> list[float]:
    """The largest radius that each corner of a line has room for, m."""
    lengths = np.linalg.norm(np.diff(line, axis=0), axis=1)
    room = TANGENT_SHARE * np.minimum(lengths[:-1], lengths[1:])
    return [float(radius) for radius in room / np.tan(np.abs(_turns(line)) / 2)]


def _is_town(junctions: Mapping[str, tuple[float, float]], ways: Sequence[_Way]) -> bool:
    """Whether no two streets join the same junctions, run too close to each other, or meet too sharply."""
    ends = {frozenset((way.start, way.end)) for way in ways}
    if len(junctions) < LEAST_JUNCTIONS or len(ends) < len(ways) or min(map(len, ends)) < 2:
        return False
    lines = [shapely.LineString(way.line) for way in ways]
    for i, first in enumerate(ways):
        for j, second in enumerate(ways[:i]):
            if not {first.start, first.end} & {second.start, second.end} and lines[i].distance(lines[j]) < LEAST_APART:
                return False
    return all(_least_angle(junction, ways) > LEAST_ANGLE for junction in junctions)


def _arms(junction: str, ways: Sequence[_Way]) -> list[tuple[float, _Way]]:
    """The streets of a junction by the heading (rad) in which they leave it, counter-clockwise."""
    arms = []
    for way in ways:
        if junction in (way.start, way.end):
            (x, y), (u, v) = way.arm(junction)[:2]
            arms.append((math.atan2(v - y, u - x), way))
    return sorted(arms, key=lambda arm: arm[0])


def _least_angle(junction: str, ways: Sequence[_Way]) -> float:
    """The least angle (rad) between two streets of a junction."""
    headings = [heading for heading, _ in _arms(junction, ways)]
    return min((after - before) % math.tau for before, after in pairwise([*headings, headings[0]]))


def _draw_roundabouts(
    junctions: dict[str, tuple[float, float]], ways: list[_Way], config: GeneratedTownConfig, rng: np.random.Generator
) -> list[Roundabout]:
    """Roundabouts in the place of some junctions; their streets end at the rings from now on, with one lane a side."""
    n, rings = int(rng.integers(config.roundabouts[0], config.roundabouts[1] + 1)), list[Roundabout]()
    for junction in rng.permutation(sorted(junctions)).tolist():
        arms = _arms(junction, ways)
        has_room = len(arms) == RING_ARMS and _least_angle(junction, ways) > LEAST_RING_ANGLE
        if len(rings) < n and has_room and all(_length(way.arm(junction)[:2]) > LEAST_ARM for _, way in arms):
            center, radius = junctions.pop(junction), round(rng.uniform(*config.ring_radius), 2)
            for k, (heading, way) in enumerate(arms):
                x, y = center[0] + radius * math.cos(heading), center[1] + radius * math.sin(heading)
                name = f"{junction}{chr(ord('a') + k)}"
                junctions[name] = round(x, 2), round(y, 2)
                ways[ways.index(way)] = way.moved(junction, name, junctions[name])
            names = tuple(f"{junction}{chr(ord('a') + k)}" for k in range(len(arms)))
            rings.append(Roundabout(center, radius, names))
    return rings


def _length(line: Points) -> float:
    """m."""
    return float(np.linalg.norm(np.diff(line, axis=0), axis=1).sum())


def _draw_unlit(
    junctions: Mapping[str, tuple[float, float]], rings: Sequence[Roundabout], config: GeneratedTownConfig,
    rng: np.random.Generator,
) -> frozenset[str]:  # fmt: skip
    """The junctions that get no lights; those of roundabouts always have them."""
    plain = sorted(set(junctions) - {name for ring in rings for name in ring.junctions})
    n_unlit = round((1 - rng.uniform(*config.lit)) * len(plain))
    return frozenset(rng.permutation(plain)[:n_unlit].tolist())
