"""Lights and signs of a map count for the lanes that they are for, and no post stands on a road."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
import shapely

from caldrive.datatypes import LightState, VehicleState
from caldrive.geometry import boxes_of
from caldrive.world.roads.network import RoadNetwork
from caldrive.world.roads.towns import load_roads
from caldrive.world.scene.scenery import Prop, build_scenery
from caldrive.world.scene.streets import lane_chains
from caldrive.world.scene.town_appearances import TOWN01
from caldrive.world.traffic.traffic_lights import TrafficLights
from caldrive.world.truth.labels import A1
from tests.maps import lane, lanes, light_at, road, sign_at, straight, write_junction_map, write_map, write_roads

pytestmark = pytest.mark.skipif(
    not pytest.importorskip("importlib.util").find_spec("sumo"), reason="netconvert comes with the extra opendrive"
)

WHEREVER = {
    "at the stop line": light_at(99), "over the lane": light_at(97, t=-2), "on the left": light_at(99, t=5),
    "turned away": light_at(99, more='orientation="+" hOffset="3.1"'), "two": light_at(99) + light_at(98, 5, id=8),
}  # fmt: skip


def posts_of(roads: RoadNetwork) -> list[Prop]:
    return [prop for prop in build_scenery(roads, roads.signs, TOWN01) if prop.kind in ("light_post", "sign_post")]


def assert_beside_the_road(roads: RoadNetwork) -> None:
    for prop in posts_of(roads):
        assert not roads.roadway.contains(shapely.Point(prop.pose.x, prop.pose.y))


@pytest.mark.parametrize("case", WHEREVER)
def test_a_light_counts_at_the_stop_line_and_is_seen_on_its_right_wherever_it_hangs(case: str, tmp_path: Path) -> None:
    roads = load_roads(str(write_junction_map(tmp_path, {1: WHEREVER[case]})))
    (post,) = roads.posts
    assert (post.lane, post.pose.x, post.pose.y) == ("-1_0", pytest.approx(100), pytest.approx(-5.1))
    assert post.stands_at.heading == pytest.approx(post.pose.heading)
    assert 99 <= post.stands_at.x <= 100
    assert -5.2 < post.stands_at.y < -4.9
    assert_beside_the_road(roads)
    assert roads.dropped == ()


def test_a_stop_line_is_painted_where_a_light_counts(tmp_path: Path) -> None:
    roads = load_roads(str(write_junction_map(tmp_path, {1: light_at(99)})))
    (street,) = [chain for chain in lane_chains(roads) if chain.stop]
    assert street.line.points[-1].tolist() == pytest.approx([100, -2])


def test_a_light_on_the_far_side_is_shown_before_the_junction(tmp_path: Path) -> None:
    roads = load_roads(str(write_junction_map(tmp_path, {2: light_at(3)})))
    assert [(post.lane, round(post.stands_at.x)) for post in roads.posts] == [("-1_0", 100)]
    assert_beside_the_road(roads)


def test_each_approach_has_its_own_light_and_the_others_none(tmp_path: Path) -> None:
    roads = load_roads(str(write_junction_map(tmp_path, {1: light_at(99), 4: light_at(99, id=8)})))
    assert {post.lane: post.light for post in roads.posts} == {"-1_0": "10", "-4_0": "10"}
    assert load_roads(str(write_junction_map(tmp_path / "..", {}))).posts == ()


def test_lanes_side_by_side_have_one_post_and_the_same_light(tmp_path: Path) -> None:
    roads = load_roads(str(write_junction_map(tmp_path, {1: light_at(99, t=-9)}, n_lanes=2)))
    assert {post.lane for post in roads.posts} == {"-1_0", "-1_1"}
    assert len(posts_of(roads)) == 1
    lights = TrafficLights(roads, np.random.default_rng(0))
    for k in range(300):
        cars = [VehicleState(roads.lanes["-1_1"].line.pose_at(96.0))]
        lights.step(k / 10, boxes_of(cars))
        assert len({light.state for light in lights.states()}) == 1
    assert lights.states()[0].state is LightState.GREEN
    for post in roads.posts:
        left = post.pose.y - roads.lanes[post.lane].line.pose_at(0).y
        assert A1.right < left < A1.left


@pytest.mark.parametrize("hdg", [0.0, math.pi, 1.2])
def test_a_sign_counts_right_beside_its_lane_however_its_post_is_turned(hdg: float, tmp_path: Path) -> None:
    (sign,) = load_roads(str(write_map(tmp_path, signals=sign_at(30, more=f'orientation="+" hOffset="{hdg}"')))).signs
    assert (sign.pose.x, sign.pose.y, sign.pose.heading) == pytest.approx((30, -5.1, 0), abs=1e-3)


@pytest.mark.parametrize("t", [-2.0, 5.0, -40.0])
def test_a_sign_over_the_road_on_its_left_or_far_away_stands_right_of_it(t: float, tmp_path: Path) -> None:
    roads = load_roads(str(write_map(tmp_path, signals=sign_at(30, t=t))))
    assert [(sign.stands_at.x, sign.stands_at.y) for sign in roads.signs] == [pytest.approx((30, -5.1), abs=1e-3)]
    assert_beside_the_road(roads)


def test_a_sign_counts_for_all_lanes_of_its_direction_and_stands_once(tmp_path: Path) -> None:
    of_lanes = lanes(lane(-1) + lane(-2), lane(1))
    roads = load_roads(str(write_roads(tmp_path, road(1, straight(0, 0, 0, 100), of_lanes, signals=sign_at(30, t=-9)))))
    assert sorted(sign.pose.y for sign in roads.signs) == pytest.approx([-9.1, -5.1], abs=1e-3)
    assert {(round(sign.stands_at.x, 2), round(sign.stands_at.y, 2)) for sign in roads.signs} == {(30, -9)}
    assert len(posts_of(roads)) == 1


def test_a_sign_for_traffic_that_is_not_there_is_left_out_and_counted(tmp_path: Path) -> None:
    one_way = lanes(lane(-1))
    sign = sign_at(30, more='orientation="-"')
    roads = load_roads(str(write_roads(tmp_path, road(1, straight(0, 0, 0, 100), one_way, signals=sign))))
    assert (roads.signs, roads.dropped) == ((), ("speed signs beside no lane of their direction (1)",))


def test_a_sign_inside_a_junction_counts_for_the_lane_there(tmp_path: Path) -> None:
    (sign,) = load_roads(str(write_junction_map(tmp_path, {3: sign_at(10)}))).signs
    assert (sign.pose.x, sign.pose.heading) == pytest.approx((110, 0), abs=0.5)


def test_what_was_left_out_is_said_once(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = str(write_map(tmp_path, signals=sign_at(500)))
    load_roads(path)
    load_roads(path)
    assert capsys.readouterr().err == (
        "caldrive: left out or changed in road.xodr: signals beyond the end of their road (1)\n"
    )
