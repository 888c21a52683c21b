"""The pinhole camera: where a picture is taken from, what of the plane it covers, and where a point lands in it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from caldrive.checks import MOST_PIXELS
from caldrive.compiled import Floats, f32
from caldrive.datatypes import CameraConfig, Pose, VehicleState
from caldrive.geometry import added_up, moved

LEVEL = 0.1  # rad of pitch and roll up to which the horizontal angle alone says what a picture covers
ALL_AROUND = 1e3  # tangent of half an angle that covers everything ahead


class View(NamedTuple):
    """What a camera sees, for compiled code. What a pixel shows w m ahead lies at position + w (ahead + column right +
    row down)."""

    matrix: Floats
    """(3, 4): world to clip space: x to the right and y down, over the half width and the half height of the picture,
    and w, m ahead. A point is seen where |x|, |y| <= w."""
    position: Floats
    """(3,) in m, as the next three."""
    ahead: Floats
    right: Floats
    down: Floats
    sides: Floats
    """(2, 2): on the plane, unit vectors ahead and to the left."""
    tangent: np.float32
    """Of half the horizontal angle, see `Frustum`."""
    focal: np.float32
    """Focal length in pixels."""


@dataclass(frozen=True)
class Frustum:
    """What a camera covers, seen from above."""

    eye: tuple[float, float, float]
    """In m."""
    ahead: tuple[float, float]
    """Unit vector."""
    left: tuple[float, float]
    """Unit vector."""
    tangent: float
    """Of half the horizontal angle."""


@dataclass(frozen=True)
class PinholeCamera:
    """Where a picture is taken from, and through what."""

    pose: Pose
    """On the plane; the camera looks along its heading."""
    height: float
    """m above the plane."""
    pitch: float
    """rad, + up."""
    fov: float
    """Horizontal field of view, degrees."""
    size: tuple[int, int]
    """Width and height, pixels."""
    roll: float = 0.0
    """rad, + when its right side is down."""

    def __post_init__(self) -> None:
        """Raises ValueError for a picture that no camera takes, before room is made for it."""
        if not all(isinstance(side, int | np.integer) and 1 <= side <= MOST_PIXELS for side in self.size):
            raise ValueError(
                f"found a camera of {self.size[0]!r} x {self.size[1]!r} pixels, wanted whole numbers from 1 "
                f"to {MOST_PIXELS} on each side: give CameraConfig(width=200, height=88)"
            )
        if not 0 < self.fov < 180:
            raise ValueError(f"found a camera that sees {self.fov:g}°, wanted 1° to 179°: give CameraConfig(fov=90.0)")

    @property
    def focal(self) -> float:
        """Focal length in pixels."""
        return self.size[0] / 2 / math.tan(math.radians(self.fov) / 2)

    @property
    def _axes(self) -> tuple[tuple[float, ...], tuple[float, ...], tuple[float, ...]]:
        """Unit vectors to the right, down and ahead."""
        c, s = math.cos(self.pose.heading), math.sin(self.pose.heading)
        cp, sp = math.cos(self.pitch), math.sin(self.pitch)
        right: tuple[float, ...] = (s, -c, 0.0)
        down: tuple[float, ...] = (c * sp, s * sp, -cp)
        if self.roll:
            cr, sr = math.cos(self.roll), math.sin(self.roll)
            pairs = list(zip(right, down, strict=True))
            right, down = tuple(cr * r + sr * d for r, d in pairs), tuple(cr * d - sr * r for r, d in pairs)
        return right, down, (c * cp, s * cp, sp)

    def view(self) -> View:
        """All of it, for compiled code."""
        (right, down, ahead), (width, height), focal = self._axes, self.size, self.focal
        position, frustum = (self.pose.x, self.pose.y, self.height), self.frustum()
        numbers: list[float] = []
        for axis, scale in ((right, 2 * focal / width), (down, 2 * focal / height), (ahead, 1.0)):
            numbers += [scale * a for a in axis]
            numbers.append(-scale * added_up(a * at for a, at in zip(axis, position, strict=True)))
        x, y = (1 - width) / (2 * focal), (1 - height) / (2 * focal)  # the middle of the first pixel
        numbers += [*position, *(a + x * r + y * d for a, r, d in zip(ahead, right, down, strict=True))]
        numbers += [*(r / focal for r in right), *(d / focal for d in down), *frustum.ahead, *frustum.left]
        all = np.array(numbers, np.float32)
        return View(
            all[:12].reshape(3, 4), all[12:15], all[15:18], all[18:21], all[21:24], all[24:].reshape(2, 2),
            f32(frustum.tangent), f32(focal),
        )  # fmt: skip

    def frustum(self) -> Frustum:
        """What the picture covers on the plane; where it may show what lies behind the eye, everything."""
        c, s = math.cos(self.pose.heading), math.sin(self.pose.heading)
        is_level = max(abs(self.pitch), abs(self.roll)) < LEVEL
        tangent = math.tan(math.radians(self.fov) / 2) if is_level else ALL_AROUND
        to_corner = math.atan(math.hypot(*self.size) / 2 / self.focal)
        if not is_level and abs(self.pitch) + to_corner > math.pi / 2:
            c = s = 0.0  # nothing is ahead and nothing aside
        return Frustum((self.pose.x, self.pose.y, self.height), (c, s), (-s, c), tangent)


def camera_on(ego: VehicleState, mount: CameraConfig) -> PinholeCamera:
    """The camera that a mount puts on the ego."""
    pose = moved(ego.pose, mount.forward, mount.left, mount.yaw)
    return PinholeCamera(pose, height=mount.up, pitch=0.0, fov=mount.fov, size=(mount.width, mount.height))
