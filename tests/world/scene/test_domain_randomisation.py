"""Domain randomisation: the same streets in another appearance."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from caldrive.datatypes import CameraConfig, Semantic, Sign, VehicleState
from caldrive.world.rendering.camera import CameraRig, SceneState
from caldrive.world.roads.network import RoadNetwork
from caldrive.world.roads.towns import load_roads
from caldrive.world.scene.appearance import N_BUILDING_TYPES, Appearance
from caldrive.world.scene.domain_randomisation import (
    CROWNS,
    GROUND_FLOORS,
    PAVINGS,
    UPPER_FLOORS,
    YARDS,
    town_appearance,
    town_signs,
)
from caldrive.world.scene.textures import Tex
from caldrive.world.scene.town_appearances import TOWN_APPEARANCES
from caldrive.world.town import load_town


@pytest.fixture(scope="module")
def roads() -> RoadNetwork:
    return load_roads("town01")


@pytest.mark.parametrize("town", TOWN_APPEARANCES)
def test_appearance_0_is_the_towns_own(town: str) -> None:
    assert town_appearance(town, 0) is TOWN_APPEARANCES[town]
    assert TOWN_APPEARANCES[town].number == 0
    assert len(TOWN_APPEARANCES[town].buildings) == N_BUILDING_TYPES


def test_a_random_appearance_depends_on_its_number_only() -> None:
    assert town_appearance("town01", 5) == town_appearance("town02", 5)
    assert town_appearance("town01", 5) != town_appearance("town01", 6)
    assert load_town("town01", 5).appearance.number == 5


def layers(appearance: Appearance) -> set[int]:
    """The texture layers that a town is built of."""
    grounds = {appearance.ground.pavement.layer, appearance.ground.yard.layer}
    trees = {tree.layer for tree in appearance.trees}
    return grounds | trees | {layer for kind in appearance.buildings for layer in (kind.upper, kind.ground, kind.roof)}


def test_what_only_town02_is_built_of_is_in_no_random_appearance() -> None:
    own = layers(TOWN_APPEARANCES["town02"]) - layers(TOWN_APPEARANCES["town01"]) - {Tex.PLAIN}
    assert len(own) >= 6
    assert not own & {*UPPER_FLOORS, *GROUND_FLOORS, *PAVINGS, *YARDS, *CROWNS}
    for number in range(1, 50):
        assert not own & layers(town_appearance("town01", number))


def test_of_the_limits_only_the_fast_ones_differ(roads: RoadNetwork) -> None:
    assert town_signs(roads.signs, 0) == roads.signs
    fast = {30: {30}, 60: {60, 90}, 90: {60, 90}}
    seen: dict[Sign, set[int]] = {sign: set() for sign in roads.signs}
    for number in range(1, 40):
        for own, shown in zip(roads.signs, town_signs(roads.signs, number), strict=True):
            assert shown.pose == own.pose
            seen[own].add(shown.limit)
    assert all(limits == fast[sign.limit] for sign, limits in seen.items())


def test_the_limit_on_a_sign_is_the_one_that_counts(roads: RoadNetwork) -> None:
    town = load_town("town01", 7)
    drawn = {(prop.pose, prop.limit) for prop in town.scenery if prop.kind == "sign_post"}
    assert drawn == {(sign.pose, sign.limit) for sign in town.signs}
    assert drawn != {(sign.pose, sign.limit) for sign in roads.signs}


def test_distractors_stand_beside_randomised_streets_only(roads: RoadNetwork) -> None:
    kinds = {"distractor", "shed"}
    assert not kinds & {prop.kind for town in TOWN_APPEARANCES for prop in load_town(town).scenery}
    props = [prop for prop in load_town("town01", 4).scenery if prop.kind in kinds]
    assert {prop.kind for prop in props} == kinds
    assert len({(prop.length, prop.width, prop.height) for prop in props}) == 5
    shapely.prepare(roads.roadway)
    reach = [shapely.Point(prop.pose.x, prop.pose.y).buffer(prop.length / 2) for prop in props]
    assert not shapely.intersects(roads.roadway, reach).any()


def test_houses_keep_two_floors_in_every_appearance() -> None:
    assert min(town_appearance("town01", number).layout.floors[0] for number in range(1, 200)) >= 2


def test_a_street_looks_different_and_lies_where_it_lay(roads: RoadNetwork) -> None:
    lane = max(roads.driveable, key=lambda lane: lane.line.length)
    ego = VehicleState(lane.line.pose_at(20.0), id="ego")
    pictures, classes = [], []
    for number in (0, 1, 2):
        camera = CameraRig(load_town("town01", number))
        pictures.append(camera.render(SceneState(1, ego), [CameraConfig()])[0].astype(float))
        classes.append(camera.render_semantics(SceneState(1, ego), [CameraConfig()])[0])
        camera.close()
    sidewalk, road = (classes[0] == kind for kind in (Semantic.SIDEWALK, Semantic.ROAD))
    assert sidewalk.mean() > 0.02
    for number in (1, 2):
        assert (classes[number][sidewalk | road] == classes[0][sidewalk | road]).mean() > 0.9  # but for paint and trees
        assert np.abs(pictures[number] - pictures[0])[sidewalk].mean() > 10
