"""The pinhole camera: where points land, and what lies in view."""

from __future__ import annotations

import numpy as np
import pytest

from caldrive.datatypes import CameraConfig, Pose, VehicleState
from caldrive.world.rendering.pinhole import PinholeCamera, camera_on


def test_points_land_where_the_pinhole_puts_them() -> None:
    camera = camera_on(VehicleState(Pose(10, 5, np.pi / 2)), CameraConfig())
    clip = camera.matrix() @ np.array([10 - 2.0, 5 + 1.44 + 10.0, 1.2 + 1.0, 1.0])  # 10 m ahead, 2 m left, 1 m up
    x, y = clip[:2] / clip[3]
    assert (x * 100, y * 44) == pytest.approx((-20, -10))  # px from the middle, y down


def test_a_camera_sees_what_lies_in_its_angle() -> None:
    frustum = PinholeCamera(Pose(0, 0, 0), height=1.2, pitch=0.0, fov=90.0, size=(200, 88)).frustum()
    seen = frustum.sees(np.array([(10.0, 9.0), (10.0, 11.5), (-5.0, 0.0)]), 0.5)
    assert seen.tolist() == [True, False, False]
