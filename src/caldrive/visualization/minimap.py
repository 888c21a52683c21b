"""A small map, north up: the town's roads, the route, the goal, the other cars, the people, and the ego."""

from __future__ import annotations

from collections.abc import Sequence
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
WIDENED, STRAIGHTENED = 1.5, 0.5  # m: the roads are drawn a little wider, so that they show, and with fewer corners

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
        self._base = _town(self, roads)
        draw = ImageDraw.Draw(self._base)
        draw.line(self.pixels(route.way), fill=ROUTE, width=3 * OVERSAMPLED, joint="curve")

    def pixels(self, points: Points) -> Pixels:
        """Where points (N, 2) of the world lie on the enlarged map."""
        places = (np.asarray(points) - self._middle) * (self._scale, -self._scale) + self.size * OVERSAMPLED / 2
        return [(float(x), float(y)) for x, y in places]

    def draw(self, truth: Truth) -> Picture.Image:
        """The map as of now."""
        picture = self._base.copy()
        draw = ImageDraw.Draw(picture)
        _dots(draw, self._places([person.pose for person in truth.pedestrians]), 1.5, PERSON)
        _dots(draw, self._places([car.pose for car in truth.vehicles]), 2.5, CAR)
        _dots(draw, self._places([self.goal]), 5.0, GOAL)
        draw.polygon(self.pixels(self._arrow(truth.ego.pose)), fill=EGO, outline=(0, 0, 0))
        return picture.reduce(OVERSAMPLED)

    def _places(self, poses: Sequence[Pose]) -> Pixels:
        return self.pixels(np.array([(pose.x, pose.y) for pose in poses]).reshape(-1, 2))

    def _arrow(self, pose: Pose) -> Points:
        """A triangle that points where the ego goes, of the same size on every map."""
        pixel = OVERSAMPLED / self._scale  # m in a pixel of the finished map
        corners = box_corners(pose, 12 * pixel, 10 * pixel)
        return np.array([(corners[0] + corners[3]) / 2, corners[1], corners[2]])


def _dots(draw: ImageDraw.ImageDraw, places: Pixels, radius: float, color: tuple[int, int, int]) -> None:
    """A dot at each place of the enlarged map. radius: in pixels of the finished one."""
    r = radius * OVERSAMPLED
    for x, y in places:
        draw.ellipse((x - r, y - r, x + r, y + r), fill=color)


def _town(minimap: MiniMap, roads: RoadNetwork) -> Picture.Image:
    """The roads alone."""
    side = minimap.size * OVERSAMPLED
    picture = Picture.new("RGB", (side, side), GROUND)
    draw = ImageDraw.Draw(picture)
    for polygon in _road_polygons(roads):
        draw.polygon(minimap.pixels(np.array(polygon.exterior.coords)), fill=ROAD)
        for hole in polygon.interiors:
            draw.polygon(minimap.pixels(np.array(hole.coords)), fill=GROUND)
    return picture


@lru_cache(maxsize=4)
def _road_polygons(roads: RoadNetwork) -> tuple[shapely.Polygon, ...]:
    """The roadway's polygons."""
    roadway = roads.roadway.buffer(WIDENED).simplify(STRAIGHTENED)
    return tuple(getattr(roadway, "geoms", (roadway,)))
