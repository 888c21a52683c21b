"""Puts the lights and signs of an OpenDRIVE map at the lanes that they are for.

What counts for a lane is read off the lane, wherever a post stands: a light counts at the stop line and a sign right
beside each lane of its direction. A post stands where the map has it, if drivers look there; a light that hangs on the
far side, above or on the left is shown at the stop line, on the right of the road.
"""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import replace

import shapely

from caldrive.datatypes import Pose, Sign
from caldrive.geometry import moved, to_local, wrap_angle
from caldrive.world.roads.network import Lane, LightPost, RoadNetwork, lane_area
from caldrive.world.roads.opendrive_repairs import Dropped
from caldrive.world.roads.opendrive_signals import Approach, MapSign, Signals, edge_of

NEAR_LINE, BESIDE_KERB = 5.0, (0.3, 5.0)  # m from a stop line, and right of the road's edge, where a light is seen
ASIDE = 12.0  # m right of the edge of a road up to which a sign stands
CLEAR = 0.3  # m from a post to any lane
FARTHEST_ASIDE, STEP = 30.0, 1.0  # m that a post is moved aside to stand on no lane, and in which steps
ON_LANE = 1.0  # m along a lane by which a place may miss its ends
NEAREST = 8.0  # m from a connecting road to the lane that SUMO has in its place


def furnish(roads: RoadNetwork, signals: Signals) -> tuple[RoadNetwork, Dropped]:
    """The roads with the lights and signs of a map, and how many of what no lane could be found for."""
    places = _Places(roads)
    signs = [sign for on_map in signals.signs for sign in places.signs(on_map)]
    posts = [post for approach, feet in signals.lights.items() for post in places.posts(approach, feet)]
    order = {lane: k for k, lane in enumerate(roads.lanes)}
    unique = {post.id: post for post in sorted(posts, key=lambda post: order[post.lane])}
    return replace(roads, posts=tuple(unique.values()), signs=tuple(dict.fromkeys(signs))), places.dropped


class _Places:
    """Finds lanes and free places beside them."""

    def __init__(self, roads: RoadNetwork) -> None:
        self.roads = roads
        self.dropped: Dropped = Counter()
        self.by_road: defaultdict[str, list[Lane]] = defaultdict(list)
        for lane in roads.driveable:
            self.by_road[lane.edge.partition("#")[0]].append(lane)
        self.controlled = {post.lane: post for post in roads.posts}  # all that SUMO could control
        self.areas = shapely.STRtree([lane_area(lane.line, lane.width + 2 * CLEAR) for lane in roads.lanes.values()])

    def _lanes_of(self, approach: Approach) -> list[Lane]:
        """The lanes of a road in one direction, the outermost first."""
        return self.by_road.get(edge_of(approach), [])

    def posts(self, approach: Approach, feet: Sequence[Pose]) -> Iterator[LightPost]:
        """The lights of the lanes that lead into a junction. feet: where lights for them stand on the map."""
        lanes = [lane for lane in self._lanes_of(approach) if lane.id in self.controlled]
        foot = self._light_foot(lanes[0], feet) if lanes else None
        if foot is None:
            self.dropped["traffic lights of ways that no car drives"] += len(feet)
        else:
            yield from (
                replace(self.controlled[lane.id], foot=foot, height=lane.height(lane.line.length)) for lane in lanes
            )

    def _light_foot(self, outermost: Lane, feet: Sequence[Pose]) -> Pose | None:
        """Where the light of some lanes is to be seen: beside their stop line."""
        end = outermost.line.pose_at(outermost.line.length)
        for foot in feet:
            ahead, left = to_local(end, (foot.x, foot.y)).tolist()  # type: ignore[arg-type]
            aside = -left - outermost.width / 2
            if abs(ahead) < NEAR_LINE and BESIDE_KERB[0] < aside < BESIDE_KERB[1] and self._is_free(foot):
                return Pose(foot.x, foot.y, end.heading)
        return self._free_beside(outermost, outermost.line.length)

    def signs(self, on_map: MapSign) -> Iterator[Sign]:
        """A sign for each lane that one on the map counts for."""
        beside = [
            (lane, s) for lane in self._lanes_of(on_map.approach) if (s := _place_on(lane, on_map.at)) is not None
        ]
        edge = beside[0][0].edge if beside else ""
        beside = [(lane, s) for lane, s in beside if lane.edge == edge] or self._in_junction(on_map.at)
        foot = self._sign_foot(*beside[0], on_map.foot) if beside else None
        if foot is None:
            self.dropped["speed signs beside no lane of their direction"] += 1
            return
        for lane, s in beside:
            yield Sign(lane.post_beside(s), on_map.limit, foot, lane.height(s))

    def _in_junction(self, at: Pose) -> list[tuple[Lane, float]]:
        """The lane of a junction that runs where a connecting road of the map does."""
        lanes = [lane for lane in self.roads.lanes.values() if lane.internal]
        near = [(abs(lane.line.project(at.x, at.y).left), k) for k, lane in enumerate(lanes) if _place_on(lane, at)]
        if not near or min(near)[0] > NEAREST:
            return []
        lane = lanes[min(near)[1]]
        return [(lane, lane.line.project(at.x, at.y).s)]

    def _sign_foot(self, outermost: Lane, s: float, foot: Pose) -> Pose | None:
        """Where a sign stands: on the right of its lanes, and on no other."""
        here = outermost.line.pose_at(s)
        aside = -float(to_local(here, (foot.x, foot.y))[1]) - outermost.width / 2  # type: ignore[arg-type]
        if 0 < aside < ASIDE and self._is_free(foot):
            return Pose(foot.x, foot.y, here.heading)
        return self._free_beside(outermost, s)

    def _free_beside(self, lane: Lane, s: float) -> Pose | None:
        """The nearest place on the right of a lane that is on no other."""
        steps = range(int(FARTHEST_ASIDE / STEP))
        poses = (moved(lane.post_beside(s), left=-STEP * k) for k in steps)
        return next((pose for pose in poses if self._is_free(pose)), None)

    def _is_free(self, pose: Pose) -> bool:
        return not len(self.areas.query(shapely.Point(pose.x, pose.y), predicate="intersects"))


def _place_on(lane: Lane, at: Pose) -> float | None:
    """Where along a lane (m) a place beside it is, None where it is beside another or faces another way."""
    hit = lane.line.project(at.x, at.y)
    ahead = float(to_local(lane.line.pose_at(hit.s), (at.x, at.y))[0])  # type: ignore[arg-type]
    same_way = abs(wrap_angle(hit.heading - at.heading)) < math.pi / 4
    return hit.s if same_way and abs(ahead) < ON_LANE else None
