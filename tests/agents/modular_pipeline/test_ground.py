"""Pixels to metres, against the camera that draws the pictures."""

from __future__ import annotations

import math

import numpy as np
import pytest

from caldrive.agents.modular_pipeline.ground import CELL, SIDE, GroundView, cell_middles, pixels_of
from caldrive.agents.modular_pipeline.scene import SceneClass
from caldrive.datatypes import CameraConfig, Pose, VehicleState
from caldrive.geometry import to_world
from caldrive.world.rendering.pinhole import camera_on

EGO = VehicleState(Pose(12.0, -7.0, 0.7))


@pytest.mark.parametrize(
    "camera", [CameraConfig(), CameraConfig(width=320, height=144, fov=100.0, left=0.5, up=1.5, yaw=0.9)]
)
def test_a_place_lands_where_the_renderer_draws_it(camera: CameraConfig) -> None:
    ground = np.random.default_rng(0).uniform((3.0, -6.0), (25.0, 6.0), (200, 2))
    view = camera_on(EGO, camera).view()
    world = np.column_stack((to_world(EGO.pose, ground), np.zeros(200), np.ones(200)))
    x, y, w = view.matrix @ world.T
    drawn = np.stack(((x / w + 1) * camera.width / 2, (y / w + 1) * camera.height / 2), axis=1)
    found, ahead = pixels_of(camera, ground), w > 1.0
    assert ahead.sum() > 50
    assert np.abs(found - drawn)[ahead].max() < 0.05  # of a pixel


def test_what_lies_behind_a_camera_is_nowhere_in_its_picture() -> None:
    assert np.isnan(pixels_of(CameraConfig(), np.array([[0.0, 0.0]]))).all()
    assert np.isnan(pixels_of(CameraConfig(yaw=math.pi), np.array([[8.0, 0.0]]))).all()


def picture_of(camera: CameraConfig, size: tuple[int, int]) -> np.ndarray:
    """Class probabilities (H, W, 5) of a sidewalk to the right of y = -2 m, and of a road elsewhere."""
    height, width = size
    rows = (np.arange(height) + 0.5) / height * camera.height - camera.height / 2
    columns = camera.width / 2 - (np.arange(width) + 0.5) / width * camera.width
    with np.errstate(divide="ignore"):
        left = np.where(rows[:, None] > 0, camera.up * columns / rows[:, None], 0.0)
    kinds = np.where(left < -2.0, SceneClass.SIDEWALK, SceneClass.ROAD)
    return np.eye(len(SceneClass), dtype=np.float32)[kinds]


@pytest.mark.parametrize("size", [(88, 200), (44, 100)])
def test_an_edge_in_the_picture_is_where_it_is_on_the_ground(size: tuple[int, int]) -> None:
    camera = CameraConfig()
    grid = GroundView([camera], size).grid([picture_of(camera, size)])
    for ahead in (5.0, 8.0, 12.0):
        row = grid.classes[round(ahead / CELL), :, SceneClass.ROAD]
        seen = grid.seen[round(ahead / CELL)]
        edge = (np.flatnonzero(row[seen] > 0.5)[0] + np.flatnonzero(seen)[0]) * CELL - SIDE
        assert edge == pytest.approx(-2.0, abs=0.3)


def test_probabilities_stay_probabilities_and_what_is_not_seen_is_nothing() -> None:
    camera, size = CameraConfig(), (44, 100)
    pixels = np.random.default_rng(0).dirichlet(np.ones(5), size).astype(np.float32)
    grid = GroundView([camera], size).grid([pixels])
    assert grid.classes.sum(-1)[grid.seen] == pytest.approx(1.0, abs=1e-5)
    assert not grid.classes[~grid.seen].any()
    classes, seen = grid.at(np.array([[8.0, 0.0], [1.0, 0.0], [8.0, 19.0], [99.0, 0.0], [-5.0, 0.0]]))
    assert seen.tolist() == [True, False, False, False, False]
    assert not classes[1:].any()


def test_a_second_camera_adds_what_the_first_does_not_see() -> None:
    front, left, size = CameraConfig(), CameraConfig(yaw=math.radians(50)), (44, 100)
    road, walk = (np.eye(5, dtype=np.float32)[np.full(size, kind)] for kind in (SceneClass.ROAD, SceneClass.SIDEWALK))
    one, both = GroundView([front], size).grid([road]), GroundView([front, left], size).grid([road, walk])
    assert (both.classes[one.seen] == one.classes[one.seen]).all()
    added = both.seen & ~one.seen
    assert (both.classes[added].argmax(-1) == SceneClass.SIDEWALK).all()
    middles = cell_middles().reshape(*added.shape, 2)[added]
    assert len(middles) > 500
    assert (middles[:, 1] > 0).all()
