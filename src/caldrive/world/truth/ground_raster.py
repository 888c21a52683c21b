"""What lies under the car: a raster of the town, for the shares of the car's area on the wrong ground."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray
from PIL import Image as PILImage
from PIL import ImageDraw
from shapely import STRtree

from caldrive.compiled import Integers, compiled
from caldrive.datatypes import Points, Pose, VehicleState
from caldrive.geometry import Polyline
from caldrive.world.roads.network import RoadNetwork, lane_area

CELL = 0.2  # m
MARGIN = 12.0  # m around the roads
TILE, KEPT = 600, 24  # cells along a side of a tile, and how many tiles are remembered
_SAMPLES = (12, 6)  # along and across the car
STRAIGHT = 1e-3  # rad by which a straight line turns at most from one part to the next


class _Tile(NamedTuple):
    """A square of the town, TILE cells wide."""

    lane: Integers  # the number of the lane, 0 for none
    beside: NDArray[np.bool_]  # whether it is no road


class GroundRaster:
    """The road and the lanes outside junctions in cells of CELL metres, drawn tile by tile where somebody drives."""

    def __init__(self, roads: RoadNetwork) -> None:
        x0, y0, _, _ = roads.bounds
        self.origin = np.array([x0 - MARGIN, y0 - MARGIN])
        self.lines: list[Polyline] = [lane.line for lane in roads.driveable]
        self._straight = [_heading(line) for line in self.lines]
        self._lanes = STRtree([lane_area(lane.line, lane.width) for lane in roads.driveable])
        self._road = STRtree(shapely.get_parts(roads.roadway))
        self._tiles: dict[tuple[int, int], _Tile] = {}

    def _tile(self, column: int, row: int) -> _Tile:
        """A tile by its number from the origin."""
        if (column, row) not in self._tiles:
            if len(self._tiles) >= KEPT:
                self._tiles.pop(next(iter(self._tiles)))
            low = self.origin + TILE * CELL * np.array([column, row])
            area = shapely.box(*low, *(low + TILE * CELL))
            lanes = np.sort(self._lanes.query(area))
            road = self._road.geometries[np.sort(self._road.query(area))]
            self._tiles[column, row] = _Tile(
                lane=_draw([(self._lanes.geometries[k], int(k) + 1) for k in lanes], low),
                beside=_draw([(polygon, 1) for polygon in road], low) == 0,
            )
        return self._tiles[column, row]

    def shares(self, car: VehicleState, travel: float) -> tuple[float, float]:
        """Shares in [0, 1] of the car's area on the opposite lane, and beside the road: on the sidewalk, or beyond it.
        travel: where it should drive to there, rad."""
        pose, grid, (x0, y0) = car.pose, _spread(car.length, car.width), self.origin.tolist()
        frame = pose.x - x0, pose.y - y0, math.cos(pose.heading), math.sin(pose.heading)
        under, beside, reach = np.zeros(len(grid), np.int32), 0, math.hypot(car.length, car.width) / 2
        columns, rows = ({math.floor((at + side) / (CELL * TILE)) for side in (-reach, reach)} for at in frame[:2])
        for column in columns:
            for row in rows:
                tile = self._tile(column, row)
                beside += _look_under(grid, frame, tile, (column * TILE, row * TILE), under)
        lanes = under.tolist()
        opposite = sum(lanes.count(number) for number in set(lanes) if number and self._opposes(number, pose, travel))
        return opposite / len(lanes), beside / len(lanes)

    def _opposes(self, number: int, pose: Pose, travel: float) -> bool:
        """Whether traffic on a lane runs against a direction of travel (rad)."""
        heading = self._straight[number - 1]
        if heading is None:
            heading = self.lines[number - 1].project(pose.x, pose.y).heading
        return math.cos(heading - travel) < -0.5


@compiled
def _look_under(
    grid: Points, frame: tuple[float, float, float, float], tile: _Tile, low: tuple[int, int], lanes: Integers
) -> int:
    """Writes the lanes under those points (N, 2) of a car that lie in a tile; returns how many lie beside the road.
    frame: x, y of the car from the origin, cosine and sine of its heading; low: the tile's first column and row."""
    beside, size = 0, len(tile.lane)
    for k in range(len(grid)):
        x = frame[0] + frame[2] * grid[k, 0] - frame[3] * grid[k, 1]
        y = frame[1] + frame[3] * grid[k, 0] + frame[2] * grid[k, 1]
        column, row = math.floor(x / CELL) - low[0], math.floor(y / CELL) - low[1]
        if 0 <= column < size and 0 <= row < size:
            lanes[k] = tile.lane[row, column]
            beside += tile.beside[row, column]
    return beside


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


@lru_cache(maxsize=16)
def _spread(length: float, width: float) -> Points:
    """Points spread evenly over a car, (N, 2) in its frame."""
    along = (np.arange(_SAMPLES[0]) + 0.5) / _SAMPLES[0] - 0.5
    across = (np.arange(_SAMPLES[1]) + 0.5) / _SAMPLES[1] - 0.5
    return np.stack(np.meshgrid(along * length, across * width), axis=-1).reshape(-1, 2)


def _heading(line: Polyline) -> float | None:
    """A straight line's heading, rad."""
    turns = np.abs(np.diff(line.headings))
    return float(line.headings[0]) if turns.max(initial=0.0) < STRAIGHT else None
