"""Decors made up at random: the same streets, another look."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from caldrive.datatypes import CameraConfig, Sign, VehicleState
from caldrive.world.rendering.camera import CameraRig, Shot
from caldrive.world.roads.network import RoadNetwork
from caldrive.world.roads.towns import load_roads
from caldrive.world.scene.decor import TOWNS
from caldrive.world.scene.domain_randomisation import (
    GROUND_FLOOR,
    N_DESIGNS,
    PAVINGS,
    UPPER,
    YARDS,
    randomised_decor,
    shown_signs,
)
from caldrive.world.scene.scenery import build_scenery
from caldrive.world.scene.textures import Tex
from caldrive.world.town import load_town


@pytest.fixture(scope="module")
def roads() -> RoadNetwork:
    return load_roads("town01")


@pytest.mark.parametrize("town", TOWNS)
def test_arrangement_0_is_the_town_as_it_is(town: str) -> None:
    assert randomised_decor(town, 0) is TOWNS[town]
    assert len(TOWNS[town].designs) == N_DESIGNS


def test_a_decor_depends_on_its_number_only() -> None:
    assert randomised_decor("town01", 5) == randomised_decor("town01", 5)
    assert randomised_decor("town01", 5) != randomised_decor("town01", 6)


def test_what_only_town02_is_built_of_is_in_no_made_up_decor() -> None:
    def used(name: str) -> set[Tex]:
        decor = TOWNS[name]
        grounds = {decor.ground.pavement[0], decor.ground.yard[0], *(crown.layer for crown in decor.crowns)}
        return grounds | {layer for d in decor.designs for layer in (d.upper, d.ground, d.roof)}

    own = used("town02") - used("town01") - {Tex.PLAIN}
    assert len(own) >= 6
    assert not own & {*UPPER, *GROUND_FLOOR, *PAVINGS, *YARDS}
    made_up = randomised_decor("town01", 3)
    assert not own & {layer for design in made_up.designs for layer in (design.upper, design.ground, design.roof)}
    assert not own & {crown.layer for crown in made_up.crowns}


def test_of_the_limits_only_the_fast_ones_differ(roads: RoadNetwork) -> None:
    assert shown_signs(roads.signs, 0) == roads.signs
    fast = {30: {30}, 60: {60, 90}, 90: {60, 90}}
    seen: dict[Sign, set[int]] = {sign: set() for sign in roads.signs}
    for number in range(1, 40):
        for own, shown in zip(roads.signs, shown_signs(roads.signs, number), strict=True):
            assert shown.pose == own.pose
            seen[own].add(shown.limit)
    assert all(limits == fast[sign.limit] for sign, limits in seen.items())


def test_the_limit_on_a_sign_is_the_one_that_counts(roads: RoadNetwork) -> None:
    town = load_town("town01", 7)
    drawn = {(prop.pose, prop.label) for prop in town.scenery if prop.kind == "sign_post"}
    assert drawn == {(sign.pose, sign.limit) for sign in town.signs}
    assert drawn != {(sign.pose, sign.limit) for sign in roads.signs}


def test_things_of_no_particular_kind_stand_beside_made_up_streets_only(roads: RoadNetwork) -> None:
    odd = {"oddment", "shed"}
    assert not odd & {prop.kind for town in TOWNS for prop in build_scenery(load_roads(town))}
    props = [prop for prop in build_scenery(roads, 4) if prop.kind in odd]
    assert {prop.kind for prop in props} == odd
    assert len({(prop.length, prop.width, prop.height) for prop in props}) == 5
    shapely.prepare(roads.roadway)
    reach = [shapely.Point(prop.pose.x, prop.pose.y).buffer(prop.length / 2) for prop in props]
    assert not shapely.intersects(roads.roadway, reach).any()


def test_houses_keep_two_floors_whatever_the_decor() -> None:
    assert min(randomised_decor("town01", k).style.floors[0] for k in range(1, 200)) >= 2


def test_a_street_looks_different_and_lies_where_it_lay(roads: RoadNetwork) -> None:
    lane = max(roads.driveable, key=lambda lane: lane.line.length)
    ego = VehicleState(lane.line.pose_at(20.0), 0.0, 4.2, 1.8, "ego")
    pictures, classes = [], []
    for number in (0, 1, 2):
        camera = CameraRig(load_town("town01", number))
        pictures.append(camera.render(Shot(1, ego, [], [], {}, 0.0), [CameraConfig()])[0].astype(float))
        classes.append(camera.render_semantics(Shot(1, ego, [], []), [CameraConfig()])[0])
        camera.close()
    sidewalk, road = (classes[0] == kind for kind in (3, 1))
    assert sidewalk.mean() > 0.02
    for other in (1, 2):
        assert (classes[other][sidewalk | road] == classes[0][sidewalk | road]).mean() > 0.9  # but for paint and trees
        assert np.abs(pictures[other] - pictures[0])[sidewalk].mean() > 10
