"""The road network: lanes with their centre lines (inside junctions too), turns, stop lines, light posts and signs.

Always read from a SUMO network; where it comes from (a shipped town, an OpenDRIVE map) is the matter of `towns`.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
import shapely
import sumolib
from numpy.typing import NDArray

from caldrive.datatypes import Command, Pose, Sign
from caldrive.geometry import Polyline, moved, to_local, wrap_angle

SIDEWALK_WIDTH = 3.0
POST_BESIDE_LANE = 1.1  # m from the kerb to the foot of a post
_TURNS = {"l": Command.LEFT, "L": Command.LEFT, "r": Command.RIGHT, "R": Command.RIGHT, "s": Command.STRAIGHT}


@dataclass(frozen=True)
class Lane:
    """A driving lane. limit in km/h; successors are lane ids; internal lanes lie inside junctions.

    turn: the command that leads along this lane, for internal lanes of true junctions. light: (traffic light id, link).
    """

    id: str
    line: Polyline
    width: float
    limit: float
    internal: bool = False
    successors: tuple[str, ...] = ()
    turn: Command | None = None
    light: tuple[str, int] | None = None


@dataclass(frozen=True)
class LightPost:
    """A post with a light for one approach: foot pose (heading of the traffic it faces), stop line, SUMO links."""

    light: str
    lane: str
    links: tuple[int, ...]
    pose: Pose
    stop_line: tuple[tuple[float, float], tuple[float, float]]

    @cached_property
    def id(self) -> str:
        return f"{self.light}/{self.lane}"


@dataclass(frozen=True, eq=False)
class RoadNetwork:
    """A town's roads. network: the SUMO file. style: which look the camera gives it."""

    name: str
    network: Path
    style: str
    lanes: dict[str, Lane]
    posts: tuple[LightPost, ...]
    signs: tuple[Sign, ...]

    @cached_property
    def roadway(self) -> shapely.MultiPolygon:
        """The asphalt: all driving lanes and the junctions, as a valid (multi)polygon."""
        strips = [
            shapely.LineString(lane.line.points).buffer(lane.width / 2 + 0.01, cap_style="flat")
            for lane in self.lanes.values()
        ]
        whole = shapely.union_all(strips).buffer(1.5).buffer(-1.5)  # closes the gaps between the lanes of a junction
        return shapely.MultiPolygon([whole]) if whole.geom_type == "Polygon" else whole

    @cached_property
    def sidewalk(self) -> shapely.MultiPolygon:
        """What pedestrians walk on: a strip along every kerb."""
        strip = self.roadway.buffer(SIDEWALK_WIDTH).difference(self.roadway)
        return shapely.MultiPolygon([strip]) if strip.geom_type == "Polygon" else strip

    @cached_property
    def bounds(self) -> tuple[float, float, float, float]:
        """x_min, y_min, x_max, y_max of the roadway in metres."""
        x0, y0, x1, y1 = self.roadway.bounds
        return float(x0), float(y0), float(x1), float(y1)

    @cached_property
    def driveable(self) -> tuple[Lane, ...]:
        """Lanes outside junctions, in the order of their ids."""
        return tuple(lane for _, lane in sorted(self.lanes.items()) if not lane.internal)

    @cached_property
    def _boxes(self) -> NDArray[np.float64]:
        lines = [lane.line.points for lane in self.driveable]
        return np.array([(*line.min(0), *line.max(0)) for line in lines])

    def lane_at(self, pose: Pose) -> tuple[Lane, float]:
        """The lane under a pose that runs its way, and the arc length there. Raises ValueError over 4 m off any."""
        best: tuple[float, Lane, float] | None = None
        boxes = self._boxes
        around = (boxes[:, :2] < (pose.x + 4.0, pose.y + 4.0)) & (boxes[:, 2:] > (pose.x - 4.0, pose.y - 4.0))
        for lane in (self.driveable[i] for i in np.flatnonzero(around.all(1))):
            hit = lane.line.project(pose.x, pose.y)
            if math.cos(hit.heading - pose.heading) > 0.5 and (best is None or abs(hit.left) < best[0]):
                best = (abs(hit.left), lane, hit.s)
        if best is None or best[0] > 4.0:
            raise ValueError(
                f"found no lane of {self.name} at ({pose.x:.1f}, {pose.y:.1f}) with heading {_degrees(pose)}, "
                f"wanted a place on a lane: the nearest is {self._nearest(pose.x, pose.y)}"
            )
        return best[1], best[2]

    def _closest(self, x: float, y: float) -> tuple[Lane, Pose]:
        """The lane that runs nearest to a place, and where it is nearest."""
        hits = [(lane, lane.line.project(x, y)) for lane in self.driveable]
        lane, hit = min(hits, key=lambda pair: abs(pair[1].left))
        return lane, lane.line.pose_at(hit.s)

    def _nearest(self, x: float, y: float) -> str:
        lane, at = self._closest(x, y)
        return f"{lane.id} at ({at.x:.1f}, {at.y:.1f}) with heading {_degrees(at)}"

    def nearest_heading(self, x: float, y: float) -> float:
        """The heading of the lane that runs nearest to a place, rad."""
        return self._closest(x, y)[1].heading


def _degrees(pose: Pose) -> str:
    """A heading as a person types it."""
    return f"{math.degrees(pose.heading):.0f}°"


def _allows_cars(lane: sumolib.net.lane.Lane) -> bool:
    return bool(lane.allows("passenger"))


def _read_lanes(net: sumolib.net.Net) -> dict[str, Lane]:
    lanes: dict[str, Lane] = {}
    for edge in net.getEdges(withInternal=True):
        for raw in edge.getLanes():
            line = np.array(raw.getShape())[:, :2]
            if not _allows_cars(raw) or np.linalg.norm(np.diff(line, axis=0), axis=1).sum() < 1e-3:
                continue
            internal = edge.getFunction() == "internal"
            lanes[raw.getID()] = Lane(raw.getID(), Polyline(line), raw.getWidth(), raw.getSpeed() * 3.6, internal)
    return lanes


def _is_crossing(node: sumolib.net.node.Node) -> bool:
    """Whether a node is a true junction: cars come in from more than two sides."""
    incoming = (e for e in node.getIncoming() if e.getFunction() != "internal")
    return sum(any(map(_allows_cars, e.getLanes())) for e in incoming) > 2


def _join(net: sumolib.net.Net, lanes: dict[str, Lane]) -> dict[str, Lane]:
    """Adds successors, turns and lights to bare lanes."""
    joined = {}
    turns: dict[str, tuple[Command | None, tuple[str, int] | None]] = {}
    for lane in lanes.values():
        onward = [c for c in net.getLane(lane.id).getOutgoing() if c.getToLane().getID() in lanes]
        successors = tuple(c.getViaLaneID() if c.getViaLaneID() in lanes else c.getToLane().getID() for c in onward)
        joined[lane.id] = Lane(lane.id, lane.line, lane.width, lane.limit, lane.internal, successors)
        for connection, via in zip(onward, successors, strict=True):
            if lane.internal:
                turns.setdefault(via, (None, None)) if lanes[via].internal else None
                continue
            turn = _TURNS.get(connection.getDirection()) if _is_crossing(connection.getJunction()) else None
            turns[via] = (turn, (connection.getTLSID(), connection.getTLLinkIndex()) if connection.getTLSID() else None)
    for via, (turn, light) in turns.items():
        b = joined[via]
        if b.internal:
            joined[via] = Lane(b.id, b.line, b.width, b.limit, True, b.successors, turn, light)
    return joined


def stop_line(lane: Lane) -> tuple[tuple[float, float], tuple[float, float]]:
    """The two ends of the stop line across a lane's end, left end first."""
    end = lane.line.pose_at(lane.line.length)
    left, right = moved(end, left=lane.width / 2), moved(end, left=-lane.width / 2)
    return (left.x, left.y), (right.x, right.y)


def beside(lane: Lane, s: float) -> Pose:
    """Where a post stands on the right of a lane, facing its traffic."""
    return moved(lane.line.pose_at(s), left=-(lane.width / 2 + POST_BESIDE_LANE))


def _read_posts(net: sumolib.net.Net, lanes: dict[str, Lane], standing: list[Pose] | None) -> tuple[LightPost, ...]:
    """One post for each approach to a light: at the stop line, or the standing post of a map that faces it."""
    posts = []
    for lane in lanes.values():
        links = [c for c in net.getLane(lane.id).getOutgoing() if c.getTLSID()]
        if lane.internal or not links or net.getEdge(links[0].getFrom().getID()).getToNode().getType() == "dead_end":
            continue
        pose = beside(lane, lane.line.length) if standing is None else _facing(standing, lane)
        if pose is not None:
            indices = tuple(sorted(c.getTLLinkIndex() for c in links))
            posts.append(LightPost(links[0].getTLSID(), lane.id, indices, pose, stop_line(lane)))
    return tuple(posts)


def _facing(standing: list[Pose], lane: Lane) -> Pose | None:
    """The nearest standing post at the right of a lane's end that faces its traffic, or None."""
    end = lane.line.pose_at(lane.line.length)
    near = []
    for pose in standing:
        ahead, left = to_local(end, np.array([pose.x, pose.y]))
        if -12 < ahead < 12 and -9 < left < -1 and abs(wrap_angle(pose.heading - end.heading)) < math.pi / 4:
            near.append((abs(ahead), pose))
    return min(near, key=lambda pair: pair[0])[1] if near else None


def signs_at_limit_changes(lanes: dict[str, Lane]) -> tuple[Sign, ...]:
    """A sign where the limit changes, and one along each street after a junction."""
    signs = []
    before = {s: lane for lane in lanes.values() for s in lane.successors}
    for lane in lanes.values():
        if lane.internal:
            continue
        via = before.get(lane.id)
        previous = before.get(via.id) if via is not None and via.internal else via
        limit = round(lane.limit)
        after_junction = via is None or via.turn is not None
        if previous is not None and not after_junction and round(previous.limit) != limit:
            signs.append(Sign(beside(lane, 2.0), limit))
        elif after_junction and lane.line.length > 40:
            signs.append(Sign(beside(lane, lane.line.length * 0.4), limit))
    return tuple(signs)


def read_roads(
    name: str, network: Path, style: str, posts: list[Pose] | None = None, signs: Iterable[Sign] | None = None
) -> RoadNetwork:
    """Reads a SUMO network. posts and signs: those of an OpenDRIVE map; None puts them where our towns have them."""
    net = sumolib.net.readNet(str(network), withInternal=True)
    lanes = _join(net, _read_lanes(net))
    if not any(not lane.internal for lane in lanes.values()):
        raise ValueError(f"found no driving lane in {name}: give a map with lanes of type driving")
    found = tuple(signs) if signs is not None else signs_at_limit_changes(lanes)
    return RoadNetwork(name, network, style, lanes, _read_posts(net, lanes, posts), found)
