"""Roads above each other. The world is flat, and is drawn so; what is on a bridge is only kept out of the lane below.

Two roads that cross at different heights share a place on the plane, and nothing else: who drives on one of them meets
nobody from the other, and sees none of its signs, lights and markings.
"""

from __future__ import annotations

import numpy as np
import shapely
from numpy.typing import NDArray

from caldrive.geometry import Polyline
from caldrive.world.roads.network import CLEARANCE, RoadNetwork, lane_area
from caldrive.world.roads.route import Route

BESIDE, SLOPE = 25.0, 0.1  # m beside a route within which something is above, below or on it, and the slope to there
WINDOW = 150.0  # m of a route, behind and ahead, in which it is looked for a place


def crossings(roads: RoadNetwork) -> shapely.Geometry:
    """Where one lane runs above another, as an area."""
    lanes = list(roads.lanes.values())
    if roads.is_flat:
        return shapely.Polygon()
    tree = shapely.STRtree([lane_area(lane.line, lane.width) for lane in lanes])
    areas = []
    for i, j in sorted(zip(*tree.query(tree.geometries, predicate="overlaps").tolist(), strict=True)):
        if i < j:
            shared = shapely.intersection(tree.geometries[i], tree.geometries[j])
            x, y = shared.centroid.coords[0]
            low, high = (lanes[k].height(lanes[k].line.project(x, y).s) for k in (i, j))
            if abs(high - low) > CLEARANCE:
                areas.append(shared)
    return shapely.union_all(areas)


class RouteLevel:
    """The height of a route, and what is on it."""

    def __init__(self, roads: RoadNetwork, route: Route) -> None:
        self.line: Polyline = route.line
        s, heights = [np.zeros(0)], [np.zeros(0)]
        for id, begin in route.lanes:
            lane = roads.lanes[id]
            s.append(lane.line.s + begin)
            heights.append(np.array([lane.height(at) for at in lane.line.s]))
        order = np.argsort(np.concatenate(s), kind="stable")
        self._s: NDArray[np.float64] = np.concatenate(s)[order]
        self._heights: NDArray[np.float64] = np.concatenate(heights)[order]

    def holds(self, x: float, y: float, height: float, near: float | None = None) -> bool:
        """Whether something at a place and a height (m) is not above or below the route; near: m of the route."""
        hit = self.line.project(x, y, near, WINDOW)
        above = abs(float(np.interp(hit.s, self._s, self._heights)) - height)
        return abs(hit.left) > BESIDE or above < CLEARANCE + SLOPE * abs(hit.left)
