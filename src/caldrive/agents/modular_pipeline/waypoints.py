"""Waypoints: points to steer along, and the smooth row of them that leads from one pose into a lane."""

from __future__ import annotations

import math

import numpy as np

from caldrive.datatypes import Points, Pose
from caldrive.geometry import to_world

SPACING = 0.5  # m
CIRCLE = 1.17  # of the gap, the tangents with which a cubic is a quarter of a circle, nearly
AFTER = 8.0  # m of the lane that follow a turn


def smooth_into(start: Pose, lane: Pose, spacing: float = SPACING) -> Points:
    """Points (N, 2) of a cubic from a pose into a lane (a point on its middle, with its heading), and AFTER m on."""
    gap = math.hypot(lane.x - start.x, lane.y - start.y)
    n = max(2, math.ceil(gap / spacing))
    u = np.linspace(0, 1, n)[:, None]
    tangent = [CIRCLE * gap * np.array([math.cos(p.heading), math.sin(p.heading)]) for p in (start, lane)]
    p, q = np.array([start.x, start.y]), np.array([lane.x, lane.y])
    curve = (
        (2 * u**3 - 3 * u**2 + 1) * p + (u**3 - 2 * u**2 + u) * tangent[0]
        + (3 * u**2 - 2 * u**3) * q + (u**3 - u**2) * tangent[1]
    )  # fmt: skip
    onward = np.arange(spacing, AFTER, spacing)
    return np.concatenate((curve, to_world(lane, np.stack((onward, 0 * onward), axis=1))))


def straight_to(start: Pose, end: Pose) -> Points:
    """Points (N, 2) from one pose to another, without the last."""
    n = max(1, round(math.hypot(end.x - start.x, end.y - start.y) / SPACING))
    return np.linspace((start.x, start.y), (end.x, end.y), n, endpoint=False)


def waypoint_ahead(points: Points, origin: tuple[float, float], distance: float) -> tuple[float, float]:
    """The first of the points (N, 2) that lies ahead of an origin and at least so far from it, else the last."""
    d = points - origin
    far = np.flatnonzero((np.hypot(d[:, 0], d[:, 1]) >= distance) & (d[:, 0] > 0))
    x, y = points[far[0] if len(far) else -1].tolist()
    return x, y
