"""The semantic image: it shows the same scene as the picture, pixel by pixel."""

from __future__ import annotations

from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

from caldrive.datatypes import CameraConfig, PedestrianState, Semantic, VehicleState
from caldrive.geometry import moved
from caldrive.world.rendering.camera import CameraRig, SceneState
from caldrive.world.roads.network import RoadNetwork
from caldrive.world.roads.towns import load_roads
from caldrive.world.town import load_town
from tests.maps import write_one_way_map

MOUNT = CameraConfig(400, 176)


@pytest.fixture(scope="module")
def roads() -> RoadNetwork:
    return load_roads("town01")


@pytest.fixture(scope="module")
def approach(roads: RoadNetwork) -> VehicleState:
    """20 m before a sign."""
    lane, s = roads.lane_at(roads.signs[0].pose)
    return VehicleState(lane.line.pose_at(s - 20))


def test_a_car_and_a_person_are_where_the_picture_changes(camera: CameraRig, approach: VehicleState) -> None:
    car = VehicleState(moved(approach.pose, forward=12, left=0.3), id="a")
    person = PedestrianState(moved(approach.pose, forward=9, left=3.0, turn=1.5), 1.0, on_road=True, id="b")
    empty, full = (camera.render(SceneState(1, approach, c, p), [MOUNT])[0] for c, p in (((), ()), ([car], [person])))
    kinds = camera.render_semantics(SceneState(1, approach, [car], [person]), [MOUNT])[0]
    changed = np.abs(full.astype(int) - empty).max(axis=2) > 12
    for kind in (Semantic.VEHICLE, Semantic.PERSON):
        assert (kinds == kind).sum() > 150
        assert changed[kinds == kind].mean() > 0.9
    # What changes elsewhere is the shadow on the road.
    assert np.isin(kinds[changed], (Semantic.VEHICLE, Semantic.PERSON, Semantic.ROAD, Semantic.LINE)).mean() > 0.97


def test_signs_lights_and_streets_are_told_apart(camera: CameraRig, roads: RoadNetwork, approach: VehicleState) -> None:
    kinds = camera.render_semantics(SceneState(1, approach), [MOUNT])[0]
    assert kinds[-1, 200] in (Semantic.ROAD, Semantic.LINE)
    assert set(np.unique(kinds)) >= {Semantic.SIGN, Semantic.SIDEWALK, Semantic.BUILDING, Semantic.LINE}
    lane = roads.lanes[roads.posts[0].lane]
    before = VehicleState(lane.line.pose_at(lane.line.length - 12))
    assert Semantic.LIGHT in camera.render_semantics(SceneState(1, before), [MOUNT])[0]


def test_looking_at_classes_changes_no_picture(camera: CameraRig, approach: VehicleState) -> None:
    first = camera.render(SceneState(3, approach), [MOUNT])[0]
    camera.render_semantics(SceneState(1, approach), [MOUNT])
    assert (camera.render(SceneState(3, approach), [MOUNT])[0] == first).all()


def test_the_edge_lines_of_a_one_way_street_are_equally_wide(tmp_path: Path) -> None:
    town = load_town(str(write_one_way_map(tmp_path)))
    ego = VehicleState(town.roads.driveable[0].line.pose_at(20.0))
    with closing(CameraRig(town)) as camera:
        lines = camera.render_semantics(SceneState(1, ego), [CameraConfig(800, 352)])[0][200:] == Semantic.LINE
    left, right = lines[:, :400].sum(axis=1), lines[:, 400:].sum(axis=1)
    assert right[-1] > 15
    assert np.abs(left - right).max() <= 1
