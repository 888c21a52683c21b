"""The road network: lanes with their centre lines (inside junctions too), turns, stop lines, light posts and signs.

`sumo_reader` makes it from a SUMO network; where that comes from (a shipped town, an OpenDRIVE map) is the matter of
`towns`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
import shapely
from numpy.typing import NDArray

from caldrive.datatypes import Command, Pose, Sign
from caldrive.geometry import Polyline, added_up, moved

SIDEWALK_WIDTH = 3.0  # m
POST_BESIDE_LANE = 1.1  # m from the kerb to the foot of a post
ON_LANE = 4.0  # m from a lane's middle within which a place is on it
CLEARANCE = 2.5  # m between two roads of which one runs above the other
OUT_OF_THE_WORLD = 1e8  # m from the origin
StopLine = tuple[tuple[float, float], tuple[float, float]]  # its ends, left end first, m


@dataclass(frozen=True)
class Lane:
    """A driving lane."""

    id: str
    line: Polyline
    """Its middle, in the direction of travel."""
    width: float
    """m."""
    limit: float
    """km/h."""
    internal: bool = False
    """Whether it lies inside a junction."""
    successors: tuple[str, ...] = ()
    """Ids of the lanes that it leads to."""
    turn: Command | None = None
    """The command that leads along it, for internal lanes of true junctions."""
    light: tuple[str, int] | None = None
    """The traffic light that it obeys: its id, and the link of it."""
    heights: NDArray[np.float64] | None = None
    """m, at each point of the line; None at 0."""

    def height(self, s: float) -> float:
        """The height s m along it, m."""
        return 0.0 if self.heights is None else float(np.interp(s, self.line.s, self.heights))

    @property
    def edge(self) -> str:
        """The id of the lanes side by side that it is one of (SUMO's edge)."""
        return self.id.rsplit("_", 1)[0]

    @property
    def stop_line(self) -> StopLine:
        """Across its end."""
        end = self.line.pose_at(self.line.length)
        left, right = moved(end, left=self.width / 2), moved(end, left=-self.width / 2)
        return (left.x, left.y), (right.x, right.y)

    def post_beside(self, s: float, *, away: float = POST_BESIDE_LANE) -> Pose:
        """Where a post stands on its right, s m along it and so many metres off, facing its traffic."""
        return moved(self.line.pose_at(s), left=-(self.width / 2 + away))


@dataclass(frozen=True)
class LightPost:
    """A light for one lane that leads into a junction."""

    light: str
    """The junction's traffic light."""
    lane: str
    """The lane that ends before it."""
    links: tuple[int, ...]
    """The light's links (SUMO's) that begin on the lane."""
    pose: Pose
    """Right beside the lane's end, with the heading of its traffic: what labels go by."""
    stop_line: StopLine
    """Across the lane's end."""
    foot: Pose | None = None
    """Where the post stands, if it is not there."""
    height: float = 0.0
    """Of the road there, m."""

    @cached_property
    def id(self) -> str:
        """Of the light and the lane."""
        return f"{self.light}/{self.lane}"

    @property
    def approach(self) -> tuple[str, str]:
        """The light and the edge: lanes side by side are green together."""
        return self.light, self.lane.rsplit("_", 1)[0]

    @property
    def stands_at(self) -> Pose:
        """Where the post is to be seen."""
        return self.foot or self.pose


@dataclass(frozen=True, eq=False)
class RoadNetwork:
    """A town's roads."""

    name: str
    network: Path
    """The SUMO file."""
    appearance: str
    """The town of `TOWN_APPEARANCES` that it looks like."""
    lanes: dict[str, Lane]
    """By their ids."""
    posts: tuple[LightPost, ...]
    signs: tuple[Sign, ...]
    offset: tuple[float, float] = (0.0, 0.0)
    """m to add to a place for that in the map's file: a map that lies far away is moved to the origin."""
    dropped: tuple[str, ...] = ()
    """What of the map was left out or changed, such as `signals without a type (2)`."""

    @cached_property
    def roadway(self) -> shapely.Geometry:
        """The asphalt: all driving lanes and the junctions, as a valid polygon or several."""
        strips = [
            shapely.LineString(lane.line.points).buffer(lane.width / 2 + 0.01, cap_style="flat")
            for lane in self.lanes.values()
        ]
        return shapely.union_all(strips).buffer(1.5).buffer(-1.5)  # closes the gaps between the lanes of a junction

    @cached_property
    def sidewalk(self) -> shapely.Geometry:
        """What pedestrians walk on: a strip along every kerb."""
        return self.roadway.buffer(SIDEWALK_WIDTH).difference(self.roadway)

    @cached_property
    def bounds(self) -> tuple[float, float, float, float]:
        """x_min, y_min, x_max, y_max of the roadway in metres."""
        x0, y0, x1, y1 = self.roadway.bounds
        return float(x0), float(y0), float(x1), float(y1)

    @cached_property
    def driveable(self) -> tuple[Lane, ...]:
        """Lanes outside junctions, in the order of their ids."""
        return tuple(lane for _, lane in sorted(self.lanes.items()) if not lane.internal)

    def beside(self, lane: Lane) -> tuple[str, ...]:
        """The ids of the lanes right and left of one, that run its way; none inside junctions."""
        if lane.internal:
            return ()
        edge, _, index = lane.id.rpartition("_")
        ids = (f"{edge}_{int(index) - 1}", f"{edge}_{int(index) + 1}")
        return tuple(id for id in ids if id in self.lanes)

    @staticmethod
    def is_left_of(lane: Lane, other: Lane) -> bool:
        """Which of two lanes side by side is on the left: SUMO counts them from the right."""
        return int(lane.id.rpartition("_")[2]) > int(other.id.rpartition("_")[2])

    @cached_property
    def is_flat(self) -> bool:
        """Whether no road can run above another."""
        heights = [np.zeros(1) if lane.heights is None else lane.heights for lane in self.lanes.values()]
        return float(np.ptp(np.concatenate(heights))) < CLEARANCE

    @cached_property
    def road_length(self) -> float:
        """m of all streets, each of its two ways counted, its lanes beside each other not."""
        return added_up({lane.edge: lane.line.length for lane in self.driveable}.values())

    @cached_property
    def predecessors(self) -> dict[str, list[str]]:
        """The ids of the lanes that lead to each lane."""
        before: dict[str, list[str]] = {id: [] for id in self.lanes}
        for lane in self.lanes.values():
            for successor in lane.successors:
                before[successor].append(lane.id)
        return before

    @cached_property
    def _boxes(self) -> NDArray[np.float64]:
        """Bounding boxes (N, 4) of the driveable lanes: x_min, y_min, x_max, y_max in m."""
        lines = [lane.line.points for lane in self.driveable]
        return np.array([(*line.min(0), *line.max(0)) for line in lines])

    def lane_at(self, pose: Pose) -> tuple[Lane, float]:
        """The lane under a pose that runs its way, and the arc length there (m). Raises ValueError over 4 m off any."""
        self._require_near(pose.x, pose.y)
        best: tuple[float, Lane, float] | None = None
        low, high, at = self._boxes[:, :2], self._boxes[:, 2:], (pose.x, pose.y)
        around = (low < np.add(at, ON_LANE)) & (high > np.subtract(at, ON_LANE))
        for lane in (self.driveable[i] for i in np.flatnonzero(around.all(1))):
            hit = lane.line.project(pose.x, pose.y)
            same_way = math.cos(hit.heading - pose.heading) > 0.5
            if same_way and (best is None or abs(hit.left) < best[0]):
                best = (abs(hit.left), lane, hit.s)
        if best is None or best[0] > ON_LANE:
            raise ValueError(
                f"found no lane of {self.name} at ({pose.x:.1f}, {pose.y:.1f}) with heading {_degrees(pose)}, "
                f"wanted a place on a lane: the nearest is {self._nearest(pose.x, pose.y)}"
            )
        return best[1], best[2]

    def _require_near(self, x: float, y: float) -> None:
        """Raises ValueError for a place so far away that its distance cannot be reckoned."""
        if not max(abs(x), abs(y)) < OUT_OF_THE_WORLD:
            low, high = ("({:.0f}, {:.0f})".format(*corner) for corner in (self.bounds[:2], self.bounds[2:]))
            raise ValueError(f"found the place ({x:g}, {y:g}), wanted one in {self.name}: from {low} to {high}")

    def _closest(self, x: float, y: float) -> tuple[Lane, Pose]:
        """The lane that runs nearest to a place, and where it is nearest."""
        hits = [(lane, lane.line.project(x, y)) for lane in self.driveable]
        lane, hit = min(hits, key=lambda pair: abs(pair[1].left))
        return lane, lane.line.pose_at(hit.s)

    def _nearest(self, x: float, y: float) -> str:
        lane, at = self._closest(x, y)
        return f"{lane.id} at ({at.x:.1f}, {at.y:.1f}) with heading {_degrees(at)}"

    def nearest_heading(self, x: float, y: float) -> float:
        """The heading of the lane that runs nearest to a place, rad. Raises ValueError for a place out of the world."""
        self._require_near(x, y)
        return self._closest(x, y)[1].heading


def lane_area(line: Polyline, width: float) -> shapely.Polygon:
    """What a lane of some width (m) covers, by its middle."""
    return shapely.LineString(line.points).buffer(width / 2, cap_style="flat")


def rings(area: shapely.Geometry) -> list[shapely.LinearRing]:
    """All borders of a polygon or of several, outer and inner."""
    return [ring for part in shapely.get_parts(area) for ring in (part.exterior, *part.interiors)]


def _degrees(pose: Pose) -> str:
    """A heading as a person types it."""
    return f"{math.degrees(pose.heading):.0f}°"
