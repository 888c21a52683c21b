"""What stands in the towns."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from caldrive.geometry import box_corners
from caldrive.world.roads.network import SIDEWALK_WIDTH, RoadNetwork
from caldrive.world.scene.scenery import CLEAR_OF_POSTS, Prop, build_scenery
from caldrive.world.scene.town_appearances import TOWN_APPEARANCES
from caldrive.world.town import load_town


@pytest.fixture(scope="module", params=("town01", "town02"))
def town(request: pytest.FixtureRequest) -> tuple[RoadNetwork, tuple[Prop, ...]]:
    town = load_town(request.param)
    return town.roads, town.scenery


def footprints(props: tuple[Prop, ...], kind: str) -> np.ndarray:
    return np.array([shapely.Polygon(box_corners(p.pose, p.length, p.width)) for p in props if p.kind == kind])


def test_scenery_built_again_is_the_same(town: tuple[RoadNetwork, tuple[Prop, ...]]) -> None:
    roads = town[0]
    again = build_scenery(roads, roads.signs, TOWN_APPEARANCES[roads.appearance])
    assert again == town[1]


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
    solid = np.array([shapely.Polygon(box_corners(p.pose, p.length, p.width)) for p in props])
    assert not shapely.intersects(roads.roadway, solid).any()


def test_every_light_and_sign_has_its_post(town: tuple[RoadNetwork, tuple[Prop, ...]]) -> None:
    roads, props = town
    assert [p.pose for p in props if p.kind == "light_post"] == [post.pose for post in roads.posts]
    assert [(p.pose, p.limit) for p in props if p.kind == "sign_post"] == [(s.pose, s.limit) for s in roads.signs]


def test_no_tree_hides_a_post(town: tuple[RoadNetwork, tuple[Prop, ...]]) -> None:
    _, props = town
    posts, trees = (
        np.array([(p.pose.x, p.pose.y) for p in props if p.kind in kinds])
        for kinds in (("light_post", "sign_post"), ("tree",))
    )
    assert np.hypot(*(trees[:, None] - posts).transpose(2, 0, 1)).min() > CLEAR_OF_POSTS
