"""A small map, north up: the town's roads, the route, the goal, everybody on the road, and the ego."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import shapely
from PIL import Image as Picture
from PIL import ImageDraw

from caldrive.datatypes import Points, Pose, Truth
from caldrive.geometry import box_corners
from caldrive.world.roads.network import RoadNetwork
from caldrive.world.roads.route import Route

OVERSAMPLED = 2  # drawn larger and shrunk, which smooths the edges
MARGIN = 8  # pixels
GROUND, ROAD, ROUTE, GOAL = (26, 29, 34), (92, 98, 108), (88, 166, 255), (63, 220, 120)

CAR, PERSON, EGO = (255, 196, 84), (255, 120, 190), (255, 255, 255)

Pixels = list[tuple[float, float]]


class MiniMap:
    """The map of one episode. size: pixels of the square it fills."""

    def __init__(self, roads: RoadNetwork, route: Route, goal: Pose, size: int) -> None:
        self.size, self.goal = size, goal
        x0, y0, x1, y1 = roads.bounds
        self._middle = np.array(((x0 + x1) / 2, (y0 + y1) / 2))
        self._scale = (size - 2 * MARGIN) * OVERSAMPLED / max(x1 - x0, y1 - y0)
        self._base = _town(self, roads).copy()
        driven = route.line.points[route.line.s < route.length]
        end = route.line.pose_at(route.length)
        draw = ImageDraw.Draw(self._base)
        draw.line(self.pixels(np.vstack((driven, [(end.x, end.y)]))), fill=ROUTE, width=3 * OVERSAMPLED, joint="curve")

    def pixels(self, points: Points) -> Pixels:
        """Where points (N, 2) of the world lie on the enlarged map."""
        at = (np.asarray(points) - self._middle) * (self._scale, -self._scale) + self.size * OVERSAMPLED / 2
        return [(float(x), float(y)) for x, y in at]

    def draw(self, truth: Truth) -> Picture.Image:
        """The map as of now."""
        picture = self._base.copy()
        draw = ImageDraw.Draw(picture)
        _dots(
            draw, self.pixels(np.array([(p.pose.x, p.pose.y) for p in truth.pedestrians]).reshape(-1, 2)), 1.5, PERSON
        )
        _dots(draw, self.pixels(np.array([(v.pose.x, v.pose.y) for v in truth.vehicles]).reshape(-1, 2)), 2.5, CAR)
        _dots(draw, self.pixels(np.array([(self.goal.x, self.goal.y)])), 5.0, GOAL)
        draw.polygon(self.pixels(self._arrow(truth.ego.pose)), fill=EGO, outline=(0, 0, 0))
        return picture.reduce(OVERSAMPLED)

    def _arrow(self, pose: Pose) -> Points:
        """A triangle that points where the ego goes, of the same size on every map."""
        metre = OVERSAMPLED / self._scale  # metres in a pixel of the finished map
        corners = box_corners(pose, 12 * metre, 10 * metre)
        return np.array([(corners[0] + corners[3]) / 2, corners[1], corners[2]])


def _dots(draw: ImageDraw.ImageDraw, at: Pixels, radius: float, color: tuple[int, int, int]) -> None:
    r = radius * OVERSAMPLED
    for x, y in at:
        draw.ellipse((x - r, y - r, x + r, y + r), fill=color)


def _town(frame: MiniMap, roads: RoadNetwork) -> Picture.Image:
    """The roads alone."""
    side = frame.size * OVERSAMPLED
    picture = Picture.new("RGB", (side, side), GROUND)
    draw = ImageDraw.Draw(picture)
    for part in _parts(roads):
        draw.polygon(frame.pixels(np.array(part.exterior.coords)), fill=ROAD)
        for hole in part.interiors:
            draw.polygon(frame.pixels(np.array(hole.coords)), fill=GROUND)
    return picture


@lru_cache(maxsize=4)
def _parts(roads: RoadNetwork) -> tuple[shapely.Polygon, ...]:
    """The roadway, a little wider than it is so that it shows, in few corners."""
    whole = roads.roadway.buffer(1.5).simplify(0.5)
    return tuple(getattr(whole, "geoms", (whole,)))
