"""The pinhole camera: where points land, and what lies in view."""

from __future__ import annotations

import numpy as np
import pytest

from caldrive.datatypes import CameraConfig, Pose, VehicleState
from caldrive.world.rendering.pinhole import PinholeCamera, camera_on


def test_points_land_where_the_pinhole_puts_them() -> None:
    camera = camera_on(VehicleState(Pose(10, 5, np.pi / 2)), CameraConfig())
    clip = camera.view().matrix @ np.array([10 - 2.0, 5 + 1.44 + 10.0, 1.2 + 1.0, 1.0])  # 10 m ahead, 2 m left, 1 m up
    x, y = clip[:2] / clip[2]
    assert (x * 100, y * 44) == pytest.approx((-20, -10))  # px from the middle, y down


@pytest.mark.parametrize(("pitch", "roll"), [(0.0, 0.0), (-0.3, 0.0), (-np.pi / 2, 0.0), (0.2, 0.5)])
def test_what_a_pixel_shows_lands_on_it(pitch: float, roll: float) -> None:
    camera = PinholeCamera(Pose(3, -2, 0.7), height=1.2, pitch=pitch, fov=90.0, size=(200, 88), roll=roll)
    view, (column, row), away = camera.view(), (17, 60), 25.0
    point = view.position + away * (view.ahead + column * view.right + row * view.down)
    x, y, w = view.matrix @ np.append(point, 1.0)
    assert w == pytest.approx(away, rel=1e-4)
    assert ((x / w + 1) * 100 - 0.5, (y / w + 1) * 44 - 0.5) == pytest.approx((column, row), abs=1e-3)


def test_a_camera_whose_right_side_is_down_sees_what_is_on_the_right_higher() -> None:
    camera = PinholeCamera(Pose(0, 0, 0), height=1.2, pitch=0.0, fov=90.0, size=(200, 88), roll=0.3)
    right, left = (camera.view().matrix @ np.array([10.0, y, 1.2, 1.0]) for y in (-3.0, 3.0))
    assert right[1] < 0 < left[1]  # y down


@pytest.mark.parametrize(
    ("config", "message"),
    [
        (CameraConfig(width=60_000), "found a camera of 60000 x 88 pixels, wanted whole numbers from 1 to 4096"),
        (CameraConfig(width=200.5), "found a camera of 200.5 x 88 pixels"),  # type: ignore[arg-type]
        (CameraConfig(height=0), "found a camera of 200 x 0 pixels"),
        (CameraConfig(fov=0.0), "found a camera that sees 0°"),
        (CameraConfig(fov=float("nan")), "found a camera that sees nan°"),
        (CameraConfig(fov=180.0), "found a camera that sees 180°"),
    ],
)
def test_a_camera_that_cannot_be_is_refused_before_room_is_made_for_it(config: CameraConfig, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        camera_on(VehicleState(Pose(0, 0, 0)), config)
