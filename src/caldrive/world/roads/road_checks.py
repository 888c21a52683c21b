"""What is wrong with a town: checks that every generated town passes before anybody drives in it."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import replace
from itertools import chain

import networkx as nx
import numpy as np
import shapely

from caldrive.datatypes import Pose
from caldrive.geometry import Polyline, box_corners
from caldrive.world.roads.network import LightPost, RoadNetwork
from caldrive.world.scene.generated_appearance import own_appearance
from caldrive.world.scene.scenery import build_scenery
from caldrive.world.truth.labels import A1, faces

GRAIN = 1.0  # m along a street from one look to the next
REACH = 20.0  # m around a street within which a light may be seen from it
LEAST_SEEN = 12.0  # m before its stop line from which on a light is seen


def faults(roads: RoadNetwork) -> Iterator[str]:
    """A sentence for each thing that is wrong with a town, what is found quickly first; none for a sound town."""
    return chain(_unreachable(roads), _unseen_lights(roads), _misleading_lights(roads), _things_on_roadway(roads))


def _unreachable(roads: RoadNetwork) -> Iterator[str]:
    """Lanes from which some lane cannot be reached, or that cannot be reached from some lane."""
    graph = nx.DiGraph([(lane.id, successor) for lane in roads.lanes.values() for successor in lane.successors])
    graph.add_nodes_from(roads.lanes)
    connected = max(nx.strongly_connected_components(graph), key=len)
    return (f"lane {id} is not on a way round through all others" for id in roads.lanes if id not in connected)


def _approach(roads: RoadNetwork, lane: str) -> list[str]:
    """The lanes from the junction before a lane up to it, in this order."""
    ids = [lane]
    while (before := roads.predecessors[ids[0]]) and len(before) == 1 and roads.lanes[before[0]].turn is None:
        ids.insert(0, before[0])
    return ids


def _looks(roads: RoadNetwork, lanes: list[str], last: float) -> list[Pose]:
    """Places of a front axle along lanes that follow each other, on their last metres."""
    line = Polyline(np.concatenate([roads.lanes[id].line.points for id in lanes]))
    return [line.pose_at(s) for s in np.arange(line.length, max(0.0, line.length - last), -GRAIN).tolist()]


def _shows(post: LightPost, axle: Pose) -> bool:
    """Whether a light counts for a car whose front axle is there."""
    return bool(A1.among(axle, [post])) and faces(post.pose, axle)


def _unseen_lights(roads: RoadNetwork) -> Iterator[str]:
    """Lights whose posts are not in A1 all the way from LEAST_SEEN on to where A1 begins."""
    for post in roads.posts:
        standing = replace(post, pose=post.stands_at)
        looks = _looks(roads, _approach(roads, post.lane), LEAST_SEEN)
        seen = [_shows(standing, axle) for axle in looks[math.ceil(A1.near / GRAIN) :]]
        if not all(seen) or len(seen) < (LEAST_SEEN - A1.near) / GRAIN - 1:
            yield f"the light {post.id} is not seen from its lane {post.lane}"


def _misleading_lights(roads: RoadNetwork) -> Iterator[str]:
    """Lights that count for cars which are not meant."""
    own = defaultdict[tuple[str, str], set[str]](set)
    for post in roads.posts:
        own[post.approach] |= {*_approach(roads, post.lane)}
    for lane in roads.lanes.values():
        low, high = lane.line.points.min(0) - REACH, lane.line.points.max(0) + REACH
        looks = _looks(roads, [lane.id], lane.line.length)
        for post in roads.posts:
            near = bool(((post.pose.x, post.pose.y) > low).all() and ((post.pose.x, post.pose.y) < high).all())
            if near and lane.id not in own[post.approach] and any(_shows(post, axle) for axle in looks):
                yield f"the light {post.id} is seen from lane {lane.id}, for which it is not meant"


def _things_on_roadway(roads: RoadNetwork) -> Iterator[str]:
    """Things that stand on the road."""
    props = build_scenery(roads, roads.signs, own_appearance(roads.appearance))
    boxes = shapely.polygons([box_corners(prop.pose, prop.length, prop.width) for prop in props])
    for k in np.flatnonzero(shapely.intersects(roads.roadway, boxes)).tolist():
        yield f"a {props[k].kind} stands on the road at ({props[k].pose.x:.0f}, {props[k].pose.y:.0f})"
