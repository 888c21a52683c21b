"""What stands in the towns."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from caldrive.datatypes import Pose
from caldrive.geometry import box_corners
from caldrive.world.rendering.visibility import CELL, Sight
from caldrive.world.roads.network import SIDEWALK_WIDTH, RoadNetwork
from caldrive.world.roads.towns import load_roads
from caldrive.world.scene.scenery import CLEAR_OF_POSTS, Prop, build_scenery
from caldrive.world.scene.shadows import RESOLUTION, TALLEST_SHADOW, cast, shadow_heights


@pytest.fixture(scope="module", params=("town01", "town02"))
def town(request: pytest.FixtureRequest) -> tuple[RoadNetwork, tuple[Prop, ...]]:
    roads = load_roads(request.param)
    return roads, build_scenery(roads)


def footprints(props: tuple[Prop, ...], kind: str) -> np.ndarray:
    return np.array([shapely.Polygon(box_corners(p.pose, p.length, p.width)) for p in props if p.kind == kind])


def test_the_same_town_gets_the_same_scenery(town: tuple[RoadNetwork, tuple[Prop, ...]]) -> None:
    assert build_scenery(town[0]) == town[1]


def test_buildings_stand_a_metre_behind_the_sidewalk(town: tuple[RoadNetwork, tuple[Prop, ...]]) -> None:
    roads, props = town
    houses = footprints(props, "building")
    assert len(houses) > 40
    assert shapely.distance(houses, roads.roadway).min() > SIDEWALK_WIDTH + 0.99


def test_buildings_do_not_overlap(town: tuple[RoadNetwork, tuple[Prop, ...]]) -> None:
    houses = footprints(town[1], "building")
    i, j = shapely.STRtree(houses).query(houses, predicate="intersects")
    assert shapely.area(shapely.intersection(houses[i], houses[j]))[i != j].sum() == pytest.approx(0.0, abs=1e-6)


def test_nothing_solid_stands_on_the_roadway(town: tuple[RoadNetwork, tuple[Prop, ...]]) -> None:
    roads, props = town
    solid = np.array([shapely.Polygon(box_corners(p.pose, p.length, p.width)) for p in props if p.solid])
    assert not shapely.intersects(roads.roadway, solid).any()


def test_every_light_and_sign_has_its_post(town: tuple[RoadNetwork, tuple[Prop, ...]]) -> None:
    roads, props = town
    assert [p.pose for p in props if p.kind == "light_post"] == [post.pose for post in roads.posts]
    assert [(p.pose, p.label) for p in props if p.kind == "sign_post"] == [(s.pose, s.limit) for s in roads.signs]


def test_no_tree_hides_a_post(town: tuple[RoadNetwork, tuple[Prop, ...]]) -> None:
    _, props = town
    posts, trees = (
        np.array([(p.pose.x, p.pose.y) for p in props if p.kind in kinds])
        for kinds in (("light_post", "sign_post"), ("tree",))
    )
    assert np.hypot(*(trees[:, None] - posts).transpose(2, 0, 1)).min() > CLEAR_OF_POSTS


def test_a_wall_throws_its_shadow_away_from_the_sun() -> None:
    heights = np.zeros((200, 200), np.uint8)
    heights[100, :] = round(4.0 / TALLEST_SHADOW * 255)
    shade = cast(heights, np.array([0.0, np.sqrt(0.5), np.sqrt(0.5)]))  # the sun stands at 45 degrees over +y
    reach = round(4.0 / RESOLUTION)
    assert (shade[100 - reach + 2 : 100, 50] > 0).all()
    assert not shade[: 100 - reach - 1, 50].any()
    assert not shade[101:, 50].any()
    assert shade[100 - reach // 2, 50] * TALLEST_SHADOW / 255 == pytest.approx(2.0, abs=0.3)


def test_a_house_shades_what_lies_behind_it() -> None:
    house = Prop("building", Pose(0.0, 0.0, 0.0), 10.0, 10.0, 8.0)
    sun = np.array([np.sqrt(0.5), 0.0, np.sqrt(0.5)])
    shade = shadow_heights((house,), (-40.0, -40.0, 40.0, 40.0), sun)[..., 1]
    row = shade[shade.shape[0] // 2]
    assert row[round((40 - 9) / RESOLUTION)] > 0  # 4 m behind the wall that looks away from the sun
    assert row[round((40 + 9) / RESOLUTION)] == 0


def test_a_row_of_houses_hides_what_lies_behind_it() -> None:
    houses = tuple(Prop("building", Pose(0.0, float(y), 0.0), 10.0, 20.0, 8.0) for y in range(-200, 201, 20))
    seen = Sight(houses).seen_from(np.array([20.0, -4.0]), np.array([28.0, 4.0]), 150.0) * CELL
    assert seen[:, 0].min() > -30
    assert seen[:, 0].max() > 100
