"""Which actor is seen where: an instance segmentation camera's picture, and a semantic lidar's scan."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from caldrive.carla_bridge.axes import Placement, rotation
from caldrive.carla_bridge.server.lidar import Array, LidarSettings, Rays, cast, directions
from caldrive.datatypes import PedestrianState, Semantic, VehicleState
from caldrive.world.rendering.pinhole import PinholeCamera

NEAR = 0.2  # m around a body within which a point is on it
FARTHEST = 1e4  # m
LOW = 0.1  # m above the ground: what lies lower is the ground
MOVING = (Semantic.VEHICLE, Semantic.PERSON)
Body = VehicleState | PedestrianState
Numbers = NDArray[np.intp]
Classes = NDArray[np.uint8]
Pictures = Callable[[PinholeCamera], tuple[Array, Classes]]
"""Takes a picture (H, W) of distances along the optical axis, m, and one of classes, as numbers of `Semantic`."""


def owners(points: Array, bodies: Sequence[Body]) -> Numbers:
    """The number of the body that each point (N, 3) is on, -1 for none."""
    found = np.full(len(points), -1)
    for number, body in enumerate(bodies):
        c, s = math.cos(body.pose.heading), math.sin(body.pose.heading)
        x, y = points[:, 0] - body.pose.x, points[:, 1] - body.pose.y
        length, width = (body.length, body.width) if isinstance(body, VehicleState) else (2 * body.radius,) * 2
        on_it = (np.abs(x * c + y * s) < length / 2 + NEAR) & (np.abs(y * c - x * s) < width / 2 + NEAR)
        found[on_it & (points[:, 2] > LOW)] = number
    return found


def places(camera: PinholeCamera, distances: Array) -> Array:
    """Where what a picture (H, W) shows lies in the world, (H, W, 3)."""
    view, (width, height) = camera.view(), camera.size
    columns, rows = np.meshgrid(np.arange(width), np.arange(height))
    ways = view.ahead.astype(float) + columns[..., None] * view.right + rows[..., None] * view.down
    seen: Array = view.position + distances[..., None] * ways
    return seen


def instances(camera: PinholeCamera, distances: Array, classes: Classes, bodies: Sequence[Body]) -> Numbers:
    """For each pixel (H, W) the number of the body that it shows, -1 for none."""
    numbers, moving = np.full(classes.shape, -1), np.isin(classes, MOVING)
    numbers[moving] = owners(places(camera, distances)[moving], bodies)
    return numbers


@dataclass(frozen=True)
class SemanticScan:
    """What a semantic lidar says: for each channel how many points, and of all points, channel by channel, where (N, 3)
    they lie (m, its own axes, ours), the cosine of the angle at which the ray meets the surface, the class, and the
    number of the body that they are on, -1 for none."""

    counts: Array
    points: Array
    cosines: Array
    classes: Classes
    bodies: Numbers


def semantic_scan(
    lidar: LidarSettings, place: Placement, angle: float, rays: Rays, bodies: Sequence[Body]
) -> SemanticScan:
    """What a lidar finds while it turns on; no point is lost. The views of `rays` also hold classes and cosines."""
    azimuths, elevations, count = directions(lidar, angle, rays.delta)
    found = cast(place, azimuths, elevations, rays.views)
    keep = np.linalg.norm(found[:, :3], axis=1) < lidar.range
    points, classes = found[keep, :3], found[keep, 3].astype(np.uint8)
    numbers, moving = np.full(len(points), -1), np.isin(classes, MOVING)
    numbers[moving] = owners(points[moving] @ rotation(place).T + (place.x, place.y, place.z), bodies)
    counts = keep.reshape(len(lidar.elevations), count).sum(axis=1)
    return SemanticScan(counts, points, found[keep, 4], classes, numbers)


def with_cosines(pictures: Pictures) -> Callable[[PinholeCamera], Array]:
    """Views (H, W, 3) of distances, classes, and the cosine of the angle between the ray and the surface's normal, as
    the pixels around tell it."""

    def views(camera: PinholeCamera) -> Array:
        distances, classes = pictures(camera)
        distances = np.minimum(distances, FARTHEST)  # where nothing is drawn they are infinite
        seen = places(camera, distances)
        down, right = np.gradient(seen, axis=0), np.gradient(seen, axis=1)
        normal, ray = np.cross(down, right), seen - camera.view().position
        size = np.linalg.norm(normal, axis=-1) * np.linalg.norm(ray, axis=-1)
        cosines = np.abs((normal * ray).sum(axis=-1)) / np.maximum(size, 1e-12)
        return np.stack((distances, classes, cosines), axis=-1)

    return views
