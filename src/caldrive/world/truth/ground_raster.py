"""What lies under the car: a raster of the town, for the shares of the car's area on the wrong ground."""

from __future__ import annotations

import math

import numpy as np
import shapely
from numpy.typing import NDArray
from PIL import Image as PILImage
from PIL import ImageDraw

from caldrive.datatypes import Pose, VehicleState
from caldrive.geometry import Polyline, to_world
from caldrive.world.roads.network import RoadNetwork, lane_area

CELL = 0.2  # m
MARGIN = 12.0  # m around the roads
_SAMPLES = (12, 6)  # along and across the car


class GroundRaster:
    """A raster with sidewalks and the lanes outside junctions, in cells of CELL metres."""

    def __init__(self, roads: RoadNetwork) -> None:
        x0, y0, x1, y1 = roads.bounds
        self.origin = np.array([x0 - MARGIN, y0 - MARGIN])
        self.shape = (math.ceil((y1 - y0 + 2 * MARGIN) / CELL), math.ceil((x1 - x0 + 2 * MARGIN) / CELL))
        self.sidewalk = self._draw([(polygon, 1) for polygon in shapely.get_parts(roads.sidewalk)]) == 1
        self.lines: list[Polyline] = [lane.line for lane in roads.driveable]
        areas = (lane_area(lane.line, lane.width) for lane in roads.driveable)
        self.lane = self._draw([(area, number) for number, area in enumerate(areas, start=1)])  # 0: none

    def _draw(self, polygons: list[tuple[shapely.Polygon, int]]) -> NDArray[np.int32]:
        """A raster (rows, columns) with each polygon's value where it lies, 0 elsewhere; later ones lie on top."""
        canvas = PILImage.new("I", (self.shape[1], self.shape[0]))
        brush = ImageDraw.Draw(canvas)
        for polygon, value in polygons:
            for ring, color in ((polygon.exterior, value), *((hole, 0) for hole in polygon.interiors)):
                # The brush paints the cells that the border touches too: half a cell on each side.
                inner = shapely.Polygon(ring).buffer(-CELL / 2, join_style="mitre").exterior
                if not inner.is_empty:
                    brush.polygon([tuple(p) for p in (np.array(inner.coords) - self.origin) / CELL - 0.5], fill=color)
        return np.array(canvas, dtype=np.int32)

    def shares(self, car: VehicleState, travel: float) -> tuple[float, float]:
        """Shares in [0, 1] of the car's area on the opposite lane and on the sidewalk. travel: the route's heading
        there, rad."""
        cells = np.floor((_spread(car) - self.origin) / CELL).astype(int)
        inside = ((cells >= 0) & (cells < self.shape[::-1])).all(1)
        x, y = cells[inside].T
        lanes = self.lane[y, x]
        opposite = sum(
            int((lanes == number).sum())
            for number in np.unique(lanes)
            if number and self._opposes(int(number), car.pose, travel)
        )
        return opposite / len(cells), float(self.sidewalk[y, x].sum()) / len(cells)

    def _opposes(self, number: int, pose: Pose, travel: float) -> bool:
        """Whether traffic on a lane runs against a direction of travel (rad)."""
        return math.cos(self.lines[number - 1].project(pose.x, pose.y).heading - travel) < -0.5


def _spread(car: VehicleState) -> NDArray[np.float64]:
    """Points spread evenly over a car, (N, 2)."""
    along = (np.arange(_SAMPLES[0]) + 0.5) / _SAMPLES[0] - 0.5
    across = (np.arange(_SAMPLES[1]) + 0.5) / _SAMPLES[1] - 0.5
    grid = np.stack(np.meshgrid(along * car.length, across * car.width), axis=-1).reshape(-1, 2)
    return to_world(car.pose, grid)
