"""Where cars may stand when an episode starts, and how many of them a town holds."""

from __future__ import annotations

import math

import numpy as np
from scipy.spatial import KDTree

from caldrive.datatypes import Pose
from caldrive.world.roads.network import Lane, RoadNetwork

SPACING = 12.0  # m of lane that a car takes at the start
CLEAR_OF_EGO = 18.0  # m around the ego that stay free at the start


def start_places(roads: RoadNetwork) -> list[tuple[Lane, float]]:
    """Where in a town a car may stand at the start: on which lane, and how far along it (m)."""
    return [(lane, float(s)) for lane in roads.driveable for s in np.arange(SPACING, lane.line.length - 2.0, SPACING)]


def room(roads: RoadNetwork) -> int:
    """How many cars a town holds, wherever the ego stands."""
    poses = [lane.line.pose_at(s) for lane, s in start_places(roads)]
    places = np.array([(pose.x, pose.y) for pose in poses]).reshape(-1, 2)
    # The ego may stand between two places. A table of all distances would need gigabytes for a large map.
    near = KDTree(places).query_ball_point(places, CLEAR_OF_EGO + SPACING / 2, return_length=True)
    return len(places) - int(np.max(near, initial=0))


def free_places(roads: RoadNetwork, n: int, ego: Pose | None) -> list[tuple[Lane, float]]:
    """Where a car may stand at the start, away from the ego if there is one. Raises ValueError where there is no room
    for n."""
    free = []
    for lane, s in start_places(roads):
        place = lane.line.pose_at(s)
        if ego is None or math.hypot(place.x - ego.x, place.y - ego.y) > CLEAR_OF_EGO:
            free.append((lane, s))
    if n > len(free):
        raise ValueError(
            f"found {n} cars asked for, but {roads.name} has room for {len(free)}: ask for fewer with --cars"
        )
    return free
