"""What of a town is drawn: hidden tiles, details and triangles that face away are left out."""

from __future__ import annotations

import numpy as np
import pytest

from caldrive.datatypes import Pose
from caldrive.world.rendering.occlusion import CELL, OcclusionMap
from caldrive.world.rendering.pinhole import PinholeCamera
from caldrive.world.rendering.tiles import DetailLevel, Faces, TileGrid, ViewCell
from caldrive.world.rendering.town_mesh import project_town, town_vertices
from caldrive.world.scene.meshes import Surface, box, merge
from caldrive.world.scene.scenery import Prop

BLACK = Surface((0, 0, 0))


def eye_at(x: float) -> tuple[float, float, float]:
    """Half a metre above the ground."""
    return x, 0.0, 0.5


def in_view(grid: TileGrid, faces: Faces, x: float) -> np.ndarray:
    """The corners (N, 3, 3) in m of what a camera that looks along x draws."""
    camera = PinholeCamera(Pose(x, 0, 0), height=0.5, pitch=0.0, fov=90.0, size=(200, 88))
    n = len(faces.triangles)
    clip, sources = np.empty((n, 3, 3), np.float32), np.empty((n, 2), np.int32)
    positions = town_vertices(grid.vertices).positions
    many = project_town(faces, positions, camera.view(), clip, sources, 0)
    return np.asarray(positions[faces.triangles[sources[:many, 1]]])


def test_only_what_faces_the_eye_in_view_is_drawn() -> None:
    near, behind, far = (box((x, 0, 0.5), (1, 1, 1), BLACK) for x in (10.0, -10.0, 500.0))
    grid = TileGrid([(merge((near, behind, far)), DetailLevel.ALWAYS)])
    view_cell = ViewCell.around(eye_at(0.0), size=1.0, detail=30.0)
    drawn = in_view(grid, grid.seen_from(view_cell, lambda: None, far=100.0), x=0.0)
    assert len(drawn) == 2
    assert drawn[..., 0] == pytest.approx(9.5)


def test_tiles_out_of_sight_are_not_drawn() -> None:
    grid = TileGrid([(box((20.0, 0, 0.5), (1, 1, 1), BLACK), DetailLevel.ALWAYS)])
    ahead, beyond = np.array([[1, 0], [1, -1]]), np.array([[2, 0], [2, -1]])  # 12 to 24 m, and 24 to 36 m
    seen, hidden = (
        grid.seen_from(ViewCell.around(eye_at(0.0), size, detail=30.0), cells.copy, far=100.0)
        for size, cells in ((1.0, ahead), (2.0, beyond))
    )
    assert len(in_view(grid, seen, x=0.0)) == 2
    assert len(hidden.triangles) == 0


def test_details_are_drawn_near_and_their_stand_ins_far() -> None:
    levels = ((1, DetailLevel.NEAR), (2, DetailLevel.FAR))
    grid = TileGrid([(box((20, 0, 0.5), (1, 1, 1), Surface((k, 0, 0))), level) for k, level in levels])
    for x, wanted in ((0.0, 1), (-40.0, 2)):
        view_cell = ViewCell.around(eye_at(x), size=1.0, detail=40.0)
        drawn = grid.seen_from(view_cell, lambda: None, far=100.0).triangles
        assert set(grid.vertices["color"][drawn][..., 0].ravel()) == {wanted}


def test_a_row_of_houses_hides_what_lies_behind_it() -> None:
    poses = [Pose(0.0, float(y), 0.0) for y in range(-200, 201, 20)]
    houses = [Prop("building", pose, length=10.0, width=20.0, height=8.0) for pose in poses]
    seen = OcclusionMap(houses).visible_cells(np.array([20.0, -4.0]), np.array([28.0, 4.0]), far=150.0) * CELL
    assert seen[:, 0].min() > -30
    assert seen[:, 0].max() > 100
