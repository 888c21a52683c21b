"""Plane geometry: angles, frames, oriented boxes and polylines. Pure functions over numpy arrays."""

from __future__ import annotations

import math
import operator
from bisect import bisect_right
from collections.abc import Iterable
from dataclasses import dataclass
from functools import reduce
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from caldrive.datatypes import Points, Pose, VehicleState


def wrap_angle(angle: float) -> float:
    """The same angle in (-pi, pi]."""
    wrapped = math.remainder(angle, math.tau)
    return math.pi if wrapped == -math.pi else wrapped


def added_up(numbers: Iterable[float]) -> float:
    """Their sum from left to right, to the last bit the same in every Python. From 3.12 on `sum` rounds otherwise, and
    with another length of its route an episode is another one."""
    return reduce(operator.add, numbers, 0.0)


def to_local(frame: Pose, points: Points) -> Points:
    """World points (N, 2) seen from a frame: x ahead of it, y to its left."""
    c, s = math.cos(frame.heading), math.sin(frame.heading)
    d = np.asarray(points, dtype=float) - (frame.x, frame.y)
    return np.stack((c * d[..., 0] + s * d[..., 1], -s * d[..., 0] + c * d[..., 1]), axis=-1)


def to_world(frame: Pose, points: Points) -> Points:
    """Points (N, 2) of a frame in the world: the inverse of `to_local`."""
    c, s = math.cos(frame.heading), math.sin(frame.heading)
    p = np.asarray(points, dtype=float)
    return np.stack((c * p[..., 0] - s * p[..., 1] + frame.x, s * p[..., 0] + c * p[..., 1] + frame.y), axis=-1)


class Posed(Protocol):
    """Something that stands somewhere."""

    @property
    def pose(self) -> Pose:
        """Where, and which way it looks."""
        ...


def positions(things: Iterable[Posed]) -> Points:
    """Where things stand (N, 2), m."""
    return np.array([(thing.pose.x, thing.pose.y) for thing in things], dtype=float).reshape(-1, 2)


def boxes_of(cars: Iterable[VehicleState]) -> NDArray[np.float64]:
    """Cars as compiled code reads them (M, 5): x, y, heading, speed, half length."""
    rows = [(car.pose.x, car.pose.y, car.pose.heading, car.speed, car.length / 2) for car in cars]
    return np.array(rows, dtype=float).reshape(-1, 5)


def moved(pose: Pose, forward: float = 0.0, left: float = 0.0, turn: float = 0.0) -> Pose:
    """The pose after going forward and left (m), then turning (rad), all in its own frame."""
    c, s = math.cos(pose.heading), math.sin(pose.heading)
    x, y = pose.x + c * forward - s * left, pose.y + s * forward + c * left
    return Pose(x, y, wrap_angle(pose.heading + turn))


def box_corners(pose: Pose, length: float, width: float) -> Points:
    """Corners (4, 2) of a box centred on a pose, counter-clockwise from front left."""
    a, b = length / 2, width / 2
    return to_world(pose, np.array([(a, b), (-a, b), (-a, -b), (a, -b)]))


def boxes_overlap(first: Points, second: Points) -> bool:
    """Whether two convex polygons (N, 2) share a point: the separating axis theorem."""
    for polygon in (first, second):
        edges = np.roll(polygon, -1, axis=0) - polygon
        axes = np.stack((-edges[:, 1], edges[:, 0]), axis=1)
        p, q = first @ axes.T, second @ axes.T
        if np.any((p.max(0) < q.min(0)) | (q.max(0) < p.min(0))):
            return False
    return True


def points_to_segments(points: Points, starts: Points, ends: Points) -> NDArray[np.float64]:
    """Distances (N, M) from N points to M segments."""
    along = ends - starts
    t = ((points[:, None] - starts) * along).sum(-1) / np.maximum((along**2).sum(-1), 1e-12)
    nearest = starts + np.clip(t, 0, 1)[..., None] * along
    return np.asarray(np.linalg.norm(points[:, None] - nearest, axis=-1))


def polygon_distance(first: Points, second: Points) -> float:
    """Shortest distance between two convex polygons in metres, 0 where they overlap."""
    if boxes_overlap(first, second):
        return 0.0
    from_first = points_to_segments(first, second, np.roll(second, -1, axis=0))
    from_second = points_to_segments(second, first, np.roll(first, -1, axis=0))
    return float(min(from_first.min(), from_second.min()))


def mitres(points: Points) -> Points:
    """Left normals (N, 2) of a line at its points (N, 2), lengthened at corners so that offset lines stay parallel."""
    steps = np.diff(points, axis=0)
    steps /= np.maximum(np.linalg.norm(steps, axis=1, keepdims=True), 1e-9)
    left = np.stack((-steps[:, 1], steps[:, 0]), axis=1)
    before, after = np.vstack((left[:1], left)), np.vstack((left, left[-1:]))
    if np.allclose(points[0], points[-1]):
        before[0], after[-1] = left[-1], left[0]
    return np.asarray((before + after) / np.maximum(1 + (before * after).sum(1), 0.3)[:, None])


@dataclass(frozen=True)
class Projection:
    """Where a point meets a polyline: s along it (m), left of it (m, + left), and the tangent's heading there."""

    s: float
    left: float
    heading: float


BLEND = 1.0  # m to either side of a vertex over which a line's heading turns


class Polyline:
    """A directed line through points (N, 2), N >= 2, measured by arc length s in metres."""

    def __init__(self, points: Points) -> None:
        points = np.asarray(points, dtype=float)
        if points.ndim != 2 or points.shape[1] != 2:
            raise ValueError(f"a polyline needs points of shape (N, 2), found {points.shape}")
        keep = np.concatenate(([True], np.linalg.norm(np.diff(points, axis=0), axis=1) > 1e-6))
        self.kept: NDArray[np.bool_] = keep  # which of the points differ from the one before
        self.points: Points = points[keep]
        if len(self.points) < 2:
            raise ValueError(f"a polyline needs two different points, found {len(self.points)}")
        self._along = np.diff(self.points, axis=0)
        self._squares = (self._along**2).sum(1)
        self.s = np.concatenate(([0.0], np.cumsum(np.sqrt(self._squares))))
        self.headings = np.arctan2(self._along[:, 1], self._along[:, 0])
        # Single places are looked up in lists, which is several times faster than in arrays.
        self._s: list[float] = self.s.tolist()
        self._h: list[float] = self.headings.tolist()
        self._xy: list[list[float]] = self.points.tolist()

    @property
    def length(self) -> float:
        """In metres."""
        return float(self.s[-1])

    def _segment(self, s: float) -> int:
        return min(max(bisect_right(self._s, s) - 1, 0), len(self._h) - 1)

    def heading_at(self, s: float) -> float:
        """The tangent's heading at s; around a vertex it turns evenly, within BLEND metres to either side."""
        i = self._segment(s)
        ahead = s >= (self._s[i] + self._s[i + 1]) / 2
        j, vertex = (i + 1, i + 1) if ahead else (i - 1, i)
        away, reach = abs(s - self._s[vertex]), self._reach(i)
        if not 0 <= j < len(self._h) or away >= reach:
            return self._h[i]
        share = (reach - away) / (reach + self._reach(j))
        return wrap_angle(self._h[i] + share * wrap_angle(self._h[j] - self._h[i]))

    def _reach(self, i: int) -> float:
        return min(BLEND, (self._s[i + 1] - self._s[i]) / 2)

    def pose_at(self, s: float) -> Pose:
        """The pose on the line at s; beyond its ends, straight on."""
        i = self._segment(s)
        (x, y), ahead, heading = self._xy[i], s - self._s[i], self._h[i]
        return Pose(x + ahead * math.cos(heading), y + ahead * math.sin(heading), self.heading_at(s))

    def points_at(self, s: NDArray[np.float64]) -> Points:
        """The points (N, 2) at some arc lengths (N,); beyond its ends, the ends."""
        return np.stack([np.interp(s, self.s, self.points[:, k]) for k in (0, 1)], axis=1)

    def project(self, x: float, y: float, near: float | None = None, window: float = 15.0) -> Projection:
        """The closest place to a point; with `near`, only within `window` metres of that arc length."""
        first, last = 0, len(self._h)
        if near is not None:
            first, last = self._segment(near - window), self._segment(near + window) + 1
        along, d = self._along[first:last], (x, y) - self.points[first:last]
        t = np.minimum(np.maximum((d * along).sum(1) / self._squares[first:last], 0.0), 1.0)
        offset = d - t[:, None] * along
        k = int((offset**2).sum(1).argmin())
        (u, v), (p, q) = along[k].tolist(), offset[k].tolist()
        s = self._s[first + k] + float(t[k]) * math.hypot(u, v)
        return Projection(s, math.copysign(math.hypot(p, q), u * q - v * p), self.heading_at(s))


def push_out(moving: Points, fixed: Points) -> Points | None:
    """The shortest shift (2,) that takes a convex polygon out of another, or None where they do not overlap."""
    best: Points | None = None
    for polygon in (moving, fixed):
        edges = np.roll(polygon, -1, axis=0) - polygon
        axes = np.stack((-edges[:, 1], edges[:, 0]), axis=1) / np.linalg.norm(edges, axis=1)[:, None]
        p, q = moving @ axes.T, fixed @ axes.T
        ahead, behind = q.max(0) - p.min(0), p.max(0) - q.min(0)
        if np.any((ahead < 0) | (behind < 0)):
            return None
        shifts = np.where(ahead < behind, ahead, -behind)
        k = int(np.argmin(np.abs(shifts)))
        if best is None or abs(shifts[k]) < np.linalg.norm(best):
            best = shifts[k] * axes[k]
    return best
