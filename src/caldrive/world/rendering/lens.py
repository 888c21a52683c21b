"""What of a town is drawn from where: the tiles in sight of a place, and of these the triangles that face the eye."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from caldrive.datatypes import CameraConfig, Pose, VehicleState
from caldrive.geometry import moved


@dataclass(frozen=True)
class View:
    """What a camera covers: eye (3,), unit vectors ahead and to the left (2,), tangent of half the view's angle."""

    eye: NDArray[np.float64]
    ahead: NDArray[np.float64]
    left: NDArray[np.float64]
    tangent: float

    def sees(self, at: NDArray[np.floating], reach: NDArray[np.floating] | float) -> NDArray[np.bool_]:
        """Which circles around points (N, 2) of the plane reach into the view."""
        slope = math.sqrt(1 + self.tangent**2)
        sides = np.stack((self.ahead, self.left)).astype(at.dtype)
        ahead, beside = sides @ at.T - (sides @ self.eye[:2].astype(at.dtype))[:, None]
        return np.asarray((np.abs(beside) - ahead * at.dtype.type(self.tangent) < reach * slope) & (ahead > -reach))


NEAR, FAR = 0.25, 900.0  # m
Matrix = NDArray[np.float64]


@dataclass(frozen=True)
class Lens:
    """Where a picture is taken from: pose, height (m), pitch (rad, + up), horizontal view (degrees), size (px)."""

    pose: Pose
    height: float
    pitch: float
    fov: float
    size: tuple[int, int]

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
        moved_eye = rows @ np.array([self.pose.x, self.pose.y, self.height])
        return np.column_stack((rows, np.array([0, 0, -2 * FAR * NEAR / (FAR - NEAR), 0]) - moved_eye))

    def view(self) -> View:
        """What the picture covers on the plane."""
        c, s = math.cos(self.pose.heading), math.sin(self.pose.heading)
        wide = math.tan(math.radians(self.fov) / 2) if abs(self.pitch) < 0.1 else 1e3
        return View(np.array([self.pose.x, self.pose.y, self.height]), np.array([c, s]), np.array([-s, c]), wide)


def mounted(ego: VehicleState, mount: CameraConfig) -> Lens:
    """The lens of a camera on the ego."""
    pose = moved(ego.pose, mount.forward, mount.left, mount.yaw)
    return Lens(pose, mount.up, 0.0, mount.fov, (mount.width, mount.height))
