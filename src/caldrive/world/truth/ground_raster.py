"""What lies under the car: a raster of the town, for the shares of the car's area on the wrong ground."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray
from PIL import Image as PILImage
from PIL import ImageDraw
from shapely import STRtree

from caldrive.datatypes import Points, Pose, VehicleState
from caldrive.geometry import Polyline, to_world
from caldrive.world.roads.network import RoadNetwork, lane_area

CELL = 0.2  # m
MARGIN = 12.0  # m around the roads
TILE, KEPT = 2400, 8  # cells along a side of a tile, and how many tiles are remembered
_SAMPLES = (12, 6)  # along and across the car


@dataclass(frozen=True)
class _Tile:
    """A square of the town, TILE cells wide."""

    lane: NDArray[np.int32]  # the number of the lane, 0 for none
    sidewalk: NDArray[np.bool_]


class GroundRaster:
    """Sidewalks and the lanes outside junctions in cells of CELL metres, drawn tile by tile where somebody drives."""

    def __init__(self, roads: RoadNetwork) -> None:
        x0, y0, _, _ = roads.bounds
        self.origin = np.array([x0 - MARGIN, y0 - MARGIN])
        self.lines: list[Polyline] = [lane.line for lane in roads.driveable]
        self._lanes = STRtree([lane_area(lane.line, lane.width) for lane in roads.driveable])
        self._sidewalks = STRtree(shapely.get_parts(roads.sidewalk))
        self._tiles: dict[tuple[int, int], _Tile] = {}

    def _tile(self, column: int, row: int) -> _Tile:
        """A tile by its number from the origin."""
        if (column, row) not in self._tiles:
            if len(self._tiles) >= KEPT:
                self._tiles.pop(next(iter(self._tiles)))
            low = self.origin + TILE * CELL * np.array([column, row])
            area = shapely.box(*low, *(low + TILE * CELL))
            lanes = np.sort(self._lanes.query(area))
            sidewalks = self._sidewalks.geometries[np.sort(self._sidewalks.query(area))]
            self._tiles[column, row] = _Tile(
                lane=_draw([(self._lanes.geometries[k], int(k) + 1) for k in lanes], low),
                sidewalk=_draw([(polygon, 1) for polygon in sidewalks], low) == 1,
            )
        return self._tiles[column, row]

    def shares(self, car: VehicleState, travel: float) -> tuple[float, float]:
        """Shares in [0, 1] of the car's area on the opposite lane and on the sidewalk. travel: the route's heading
        there, rad."""
        cells = np.floor((_spread(car) - self.origin) / CELL).astype(int)
        tiles = cells // TILE
        lanes, sidewalk = np.zeros(len(cells), np.int32), np.zeros(len(cells), bool)
        for column, row in np.unique(tiles, axis=0).tolist():
            here = (tiles == (column, row)).all(1)
            x, y = (cells[here] % TILE).T
            tile = self._tile(column, row)
            lanes[here], sidewalk[here] = tile.lane[y, x], tile.sidewalk[y, x]
        opposite = sum(
            int((lanes == number).sum())
            for number in np.unique(lanes)
            if number and self._opposes(int(number), car.pose, travel)
        )
        return opposite / len(cells), float(sidewalk.sum()) / len(cells)

    def _opposes(self, number: int, pose: Pose, travel: float) -> bool:
        """Whether traffic on a lane runs against a direction of travel (rad)."""
        return math.cos(self.lines[number - 1].project(pose.x, pose.y).heading - travel) < -0.5


def _draw(polygons: list[tuple[shapely.Polygon, int]], low: Points) -> NDArray[np.int32]:
    """A tile (rows, columns) from its lowest corner (2,) on, with each polygon's value where it lies, 0 elsewhere;
    later ones lie on top."""
    canvas = PILImage.new("I", (TILE, TILE))
    brush = ImageDraw.Draw(canvas)
    for polygon, value in polygons:
        for ring, color in ((polygon.exterior, value), *((hole, 0) for hole in polygon.interiors)):
            # The brush paints the cells that the border touches too: half a cell on each side.
            inner = shapely.Polygon(ring).buffer(-CELL / 2, join_style="mitre").exterior
            if not inner.is_empty:
                brush.polygon([tuple(p) for p in (np.array(inner.coords) - low) / CELL - 0.5], fill=color)
    return np.array(canvas, dtype=np.int32)


def _spread(car: VehicleState) -> NDArray[np.float64]:
    """Points spread evenly over a car, (N, 2)."""
    along = (np.arange(_SAMPLES[0]) + 0.5) / _SAMPLES[0] - 0.5
    across = (np.arange(_SAMPLES[1]) + 0.5) / _SAMPLES[1] - 0.5
    grid = np.stack(np.meshgrid(along * car.length, across * car.width), axis=-1).reshape(-1, 2)
    return to_world(car.pose, grid)
