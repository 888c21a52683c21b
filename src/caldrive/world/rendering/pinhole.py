"""The pinhole camera: where a picture is taken from, what of the plane it covers, and where a point lands in it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from caldrive.checks import MOST_PIXELS
from caldrive.datatypes import CameraConfig, Pose, VehicleState
from caldrive.geometry import moved

NEAR, FAR = 0.25, 900.0  # m, the clipping planes
LEVEL = 0.1  # rad of pitch up to which the horizontal angle alone says what a picture covers
ALL_AROUND = 1e3  # tangent of half an angle that covers everything ahead
Matrix = NDArray[np.float64]


@dataclass(frozen=True)
class Frustum:
    """What a camera covers, seen from above."""

    eye: NDArray[np.float64]
    """(3,) in m."""
    ahead: NDArray[np.float64]
    """Unit vector (2,)."""
    left: NDArray[np.float64]
    """Unit vector (2,)."""
    tangent: float
    """Of half the horizontal angle."""

    def sees(self, at: NDArray[np.floating], reach: NDArray[np.floating] | float) -> NDArray[np.bool_]:
        """Which circles around points (N, 2) of the plane reach into the view. reach: their radii (N,) or one, m."""
        slope = math.sqrt(1 + self.tangent**2)
        sides = np.stack((self.ahead, self.left)).astype(at.dtype)
        ahead, beside = sides @ at.T - (sides @ self.eye[:2].astype(at.dtype))[:, None]
        return np.asarray((np.abs(beside) - ahead * at.dtype.type(self.tangent) < reach * slope) & (ahead > -reach))


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

    def matrix(self) -> Matrix:
        """World to clip space (4, 4), upside down, so that the first row read back is the top one."""
        c, s = math.cos(self.pose.heading), math.sin(self.pose.heading)
        cp, sp = math.cos(self.pitch), math.sin(self.pitch)
        ahead, right, up = np.array([c * cp, s * cp, sp]), np.array([s, -c, 0.0]), np.array([-c * sp, -s * sp, cp])
        width, height = self.size
        far = (FAR + NEAR) / (FAR - NEAR)
        rows = np.stack((2 * self.focal / width * right, -2 * self.focal / height * up, far * ahead, ahead))
        shift = rows @ np.array([self.pose.x, self.pose.y, self.height])
        return np.column_stack((rows, np.array([0, 0, -2 * FAR * NEAR / (FAR - NEAR), 0]) - shift))

    def frustum(self) -> Frustum:
        """What the picture covers on the plane."""
        c, s = math.cos(self.pose.heading), math.sin(self.pose.heading)
        tangent = math.tan(math.radians(self.fov) / 2) if abs(self.pitch) < LEVEL else ALL_AROUND
        eye = np.array([self.pose.x, self.pose.y, self.height])
        return Frustum(eye=eye, ahead=np.array([c, s]), left=np.array([-s, c]), tangent=tangent)


def camera_on(ego: VehicleState, mount: CameraConfig) -> PinholeCamera:
    """The camera that a mount puts on the ego."""
    pose = moved(ego.pose, mount.forward, mount.left, mount.yaw)
    return PinholeCamera(pose, height=mount.up, pitch=0.0, fov=mount.fov, size=(mount.width, mount.height))
