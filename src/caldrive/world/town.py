"""A loaded town as a value: its roads, signs, buildings and everything else that stands still."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from caldrive.datatypes import ContactKind, Pose, Sign
from caldrive.geometry import positions, wrap_angle
from caldrive.world.roads.levels import RouteLevel
from caldrive.world.roads.network import RoadNetwork
from caldrive.world.roads.route import Route
from caldrive.world.roads.towns import load_roads, one_sentence
from caldrive.world.scene.appearance import Appearance
from caldrive.world.scene.domain_randomisation import town_appearance, town_signs
from caldrive.world.scene.generated_appearance import own_appearance
from caldrive.world.scene.scenery import Prop, build_scenery
from caldrive.world.traffic.collisions import Obstacle, half_diagonal
from caldrive.world.truth.ground_raster import GroundRaster

SIGN_BESIDE = (-7.0, -1.0)  # m left of the route where a sign that counts for it stands
CELL = 8.0  # m: a side of the squares that what is near is found for
SAME_WAY = 0.5  # rad at most between the route and the traffic that such a sign faces


class Obstacles:
    """What stands still and can be hit, with an index of where it is."""

    def __init__(self, scenery: tuple[Prop, ...]) -> None:
        self._boxes = [
            Obstacle(ContactKind.OBJECT, f"{prop.kind}{i}", prop.pose, length=prop.length, width=prop.width)
            for i, prop in enumerate(scenery)
        ]
        self._at = positions(self._boxes)
        self._reach = np.array([half_diagonal(box) for box in self._boxes])
        self._last: tuple[tuple[int, int, float], list[tuple[Obstacle, float]]] | None = None

    def near(self, here: Pose, reach: float) -> list[Obstacle]:
        """Those that something of this reach (m) around here may touch."""
        around = self._around(math.floor(here.x / CELL), math.floor(here.y / CELL), reach)
        return [
            box
            for box, radius in around
            if math.hypot(box.pose.x - here.x, box.pose.y - here.y) - radius < reach
        ]  # fmt: skip

    def _around(self, column: int, row: int, reach: float) -> list[tuple[Obstacle, float]]:
        """Those that something of this reach anywhere in a square of CELL m may touch, each with its own reach; the
        last square's are remembered."""
        if self._last is None or self._last[0] != (column, row, reach):
            middle = CELL * (column + 0.5), CELL * (row + 0.5)
            distance = np.hypot(*(self._at - middle).T) - self._reach
            within = np.flatnonzero(distance < reach + CELL).tolist()
            self._last = (column, row, reach), [(self._boxes[i], float(self._reach[i])) for i in within]
        return self._last[1]


@dataclass(frozen=True, eq=False)
class Town:
    """Everything in a town that stands still."""

    name: str
    """As in a scenario: a name, or the path of an OpenDRIVE file."""
    appearance: Appearance
    """Its number is 0 for the town's own, else that of a random one."""
    roads: RoadNetwork
    """The same in every appearance."""
    signs: tuple[Sign, ...]
    """As they are in this appearance: limits of fast streets differ."""
    scenery: tuple[Prop, ...]
    ground: GroundRaster
    obstacles: Obstacles

    def limits_along(self, route: Route, level: RouteLevel | None = None) -> list[tuple[float, float]]:
        """Where which limit begins along a route (m, km/h); level: the route's, where roads run above each other."""
        limits = [(0.0, self.roads.lanes[route.lanes[0][0]].limit)]
        low, high = SIGN_BESIDE
        for sign in self.signs:
            if level is not None and not level.holds(sign.pose.x, sign.pose.y, sign.height):
                continue
            hit = route.line.project(sign.pose.x, sign.pose.y)
            if low < hit.left < high and abs(wrap_angle(hit.heading - sign.pose.heading)) < SAME_WAY:
                limits.append((hit.s, float(sign.limit)))
        return sorted(limits)


@lru_cache(maxsize=2)
def _ground(roads: RoadNetwork) -> GroundRaster:
    return GroundRaster(roads)


@lru_cache(maxsize=2)
def load_town(name: str, appearance: int = 0) -> Town:
    """A town by name, by seed or by OpenDRIVE file. appearance: the number of a random appearance (domain
    randomisation: other houses, trees, colours, sun, limits of the fast streets), 0 for the town's own.

    Raises ValueError or FileNotFoundError where there is none.
    """
    roads = load_roads(name)
    look = town_appearance(roads.appearance, appearance) if appearance else own_appearance(roads.appearance)
    signs = town_signs(roads.signs, appearance)
    with one_sentence(name):
        scenery = build_scenery(roads, signs, look)
        return Town(
            name=name,
            appearance=look,
            roads=roads,
            signs=signs,
            scenery=scenery,
            ground=_ground(roads),
            obstacles=Obstacles(scenery),
        )
