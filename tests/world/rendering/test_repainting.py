"""A town painted otherwise: one thing changes, and nothing else."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.ndimage import binary_dilation

from caldrive.datatypes import CameraConfig, Image, PedestrianState, Pose, Semantic, VehicleState
from caldrive.geometry import moved
from caldrive.world.rendering.camera import CameraRig, SceneState
from caldrive.world.rendering.repainting import Repainting, sign_with, without_center_lines, without_outlines
from caldrive.world.roads.network import RoadNetwork
from caldrive.world.roads.towns import load_roads
from caldrive.world.scene.people import Shown

MOUNT = CameraConfig()


@pytest.fixture(scope="module")
def roads() -> RoadNetwork:
    return load_roads("town02")


@pytest.fixture(scope="module")
def on_a_road(roads: RoadNetwork) -> Pose:
    return max(roads.driveable, key=lambda lane: lane.line.length).line.pose_at(20.0)


def picture(rig: CameraRig, at: Pose) -> Image:
    return rig.render(SceneState(1, VehicleState(at)), [MOUNT])[0]


def classes(rig: CameraRig, at: Pose) -> np.ndarray:
    return rig.render_semantics(SceneState(1, VehicleState(at)), [MOUNT])[0]


def test_a_repainted_rig_leaves_the_first_one_as_it_was(camera: CameraRig, on_a_road: Pose) -> None:
    before = picture(camera, on_a_road)
    assert (picture(camera.repainted(Repainting()), on_a_road) == before).all()
    assert (picture(camera.repainted(without_outlines()), on_a_road) != before).any()
    assert (picture(camera, on_a_road) == before).all()


def test_another_number_changes_the_signs_face_alone(camera: CameraRig) -> None:
    sign = camera.town.signs[0]
    at = moved(sign.stands_at, forward=-9.0, left=3.0)
    face = classes(camera, at) == Semantic.SIGN
    other = camera.repainted(sign_with(sign.stands_at, 90 if sign.limit == 30 else 30))
    changed = (picture(camera, at) != picture(other, at)).any(axis=2)
    assert changed.sum() > 10
    rows, columns = (np.flatnonzero(face.any(axis=axis)) for axis in (1, 0))
    near = np.zeros_like(face)
    near[rows[0] - 1 : rows[-1] + 2, columns[0] - 1 : columns[-1] + 2] = True
    assert not (changed & ~near).any()


def test_without_outlines_the_road_ends_at_the_houses(camera: CameraRig, on_a_road: Pose) -> None:
    other = camera.repainted(without_outlines())
    before, after = classes(camera, on_a_road), classes(other, on_a_road)
    was_beside = np.isin(before, (Semantic.SIDEWALK, Semantic.GROUND))
    assert was_beside.any()
    assert (after[was_beside] == Semantic.ROAD).all()
    standing = np.isin(before, (Semantic.BUILDING, Semantic.PLANT, Semantic.SKY, Semantic.FURNITURE))
    assert (after[standing] == before[standing]).all()


def test_without_centre_lines_there_is_less_paint(camera: CameraRig, on_a_road: Pose) -> None:
    before, after = (classes(rig, on_a_road) for rig in (camera, camera.repainted(without_center_lines())))
    assert 0 < (after == Semantic.LINE).sum() < (before == Semantic.LINE).sum()
    assert (after[before != Semantic.LINE] == before[before != Semantic.LINE]).all()


def test_a_person_is_drawn_in_parts(camera: CameraRig, on_a_road: Pose) -> None:
    person = PedestrianState(moved(on_a_road, forward=7.0), on_road=True, id="p")

    def drawn(shown: Shown) -> tuple[Image, np.ndarray]:
        state = SceneState(1, VehicleState(on_a_road), (), (person,), shown={"p": shown})
        return camera.render(state, [MOUNT])[0], camera.render_semantics(state, [MOUNT])[0] == Semantic.PERSON

    (image, whole), (_, legs), (_, torso) = map(drawn, (Shown.WHOLE, Shown.LEGS, Shown.TORSO))
    assert (whole == (legs | torso)).all()
    assert np.flatnonzero(legs.any(axis=1)).max() > np.flatnonzero(torso.any(axis=1)).max()
    assert 0.2 < legs.sum() / whole.sum() < 0.8
    without_shadow, same = drawn(Shown.LEGS | Shown.TORSO)
    assert (same == whole).all()
    darker = (image.astype(int) < without_shadow).any(axis=2) & ~binary_dilation(whole)
    assert darker.any()
    shadow_alone, nobody = drawn(Shown.SHADOW)
    assert not nobody.any()
    assert (shadow_alone[darker] == image[darker]).all()
