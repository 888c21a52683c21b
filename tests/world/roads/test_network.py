"""The road network: lanes lead on, turns, limits, posts and signs stand where a driver looks for them."""

from __future__ import annotations

import math
from collections import Counter

import numpy as np
import pytest
import shapely

from caldrive.datatypes import Command, Pose, Sign
from caldrive.geometry import moved, to_local, wrap_angle
from caldrive.world.roads.network import SIDEWALK_WIDTH, Lane, RoadNetwork
from caldrive.world.truth.labels import A1


def lane_beside(roads: RoadNetwork, sign: Sign) -> tuple[Lane, float, float]:
    """The closest lane whose traffic a sign faces, the arc length on it, and how far left of it the sign stands."""
    beside = []
    for lane in roads.driveable:
        hit = lane.line.project(sign.pose.x, sign.pose.y)
        if abs(wrap_angle(hit.heading - sign.pose.heading)) < 0.3:
            beside.append((abs(hit.left), lane, hit.s, hit.left))
    _, lane, s, left = min(beside, key=lambda row: row[0])
    return lane, s, left


def steps_back(roads: RoadNetwork, lane: Lane, reach: float) -> list[Lane]:
    """The lane and those before it, over a distance back from its end."""
    before = {successor: each for each in roads.lanes.values() for successor in each.successors}
    lanes, covered = [lane], lane.line.length
    while covered < reach and (lane := before[lane.id]):
        lanes.append(lane)
        covered += lane.line.length
    return lanes


def end_of(lane: Lane) -> Pose:
    return lane.line.pose_at(lane.line.length)


@pytest.mark.parametrize(("name", "junctions", "posts"), [("town01", 12, 36), ("town02", 8, 24)])
def test_towns_have_their_junctions_with_a_post_for_each_approach(
    name: str, junctions: int, posts: int, request: pytest.FixtureRequest
) -> None:
    roads: RoadNetwork = request.getfixturevalue(name)
    assert len({post.light for post in roads.posts}) == junctions
    assert set(Counter(post.light for post in roads.posts).values()) == {3}
    assert len({post.id for post in roads.posts}) == len(roads.posts) == posts


def test_every_lane_leads_on_to_lanes_that_begin_where_it_ends(town: RoadNetwork) -> None:
    for lane in town.lanes.values():
        assert lane.successors
        for successor in lane.successors:
            step = np.subtract(town.lanes[successor].line.points[0], lane.line.points[-1])
            assert np.hypot(*step) < 0.05


def test_lanes_lead_on_without_a_kink(town: RoadNetwork) -> None:
    for lane in town.lanes.values():
        for successor in lane.successors:
            assert abs(wrap_angle(town.lanes[successor].line.headings[0] - lane.line.headings[-1])) < math.radians(10)


def test_an_approach_to_a_t_junction_has_exactly_two_different_turns(town: RoadNetwork) -> None:
    for post in town.posts:
        turns = [town.lanes[id].turn for id in town.lanes[post.lane].successors]
        assert len(turns) == len(set(turns)) == 2
        assert None not in turns


def test_each_junction_offers_every_turn_twice(town: RoadNetwork) -> None:
    for light in {post.light for post in town.posts}:
        lanes = [town.lanes[post.lane] for post in town.posts if post.light == light]
        turns = Counter(town.lanes[id].turn for lane in lanes for id in lane.successors)
        assert turns == dict.fromkeys(Command, 2)


def test_a_left_turn_bends_left_and_a_right_turn_right(town: RoadNetwork) -> None:
    sides = {Command.LEFT: 1, Command.RIGHT: -1}
    for lane in town.lanes.values():
        for successor in lane.successors:
            via = town.lanes[successor]
            if via.turn in sides:
                after = town.lanes[via.successors[0]]
                while after.internal:
                    after = town.lanes[after.successors[0]]
                bend = wrap_angle(after.line.heading_at(0) - end_of(lane).heading)
                assert sides[via.turn] * bend == pytest.approx(math.pi / 2, abs=0.2)


def test_cars_may_drive_30_where_a_junction_is_near(town: RoadNetwork) -> None:
    for post in town.posts:
        approach = town.lanes[post.lane]
        for lane in steps_back(town, approach, 35.0):
            assert lane.internal or round(lane.limit) == 30
        for turn in approach.successors:
            after = town.lanes[town.lanes[turn].successors[0]]
            assert round(after.limit) == 30 or after.internal


def test_town01_knows_all_limits_and_town02_no_90(town01: RoadNetwork, town02: RoadNetwork) -> None:
    assert {round(lane.limit) for lane in town01.driveable} == {30, 60, 90}
    assert {round(lane.limit) for lane in town02.driveable} == {30, 60}


def test_every_sign_stands_right_of_a_lane_faces_its_traffic_and_tells_its_limit(town: RoadNetwork) -> None:
    assert len(town.signs) > 10
    for sign in town.signs:
        lane, s, left = lane_beside(town, sign)
        assert -6.0 < left < -2.0
        assert abs(wrap_angle(lane.line.heading_at(s) - sign.pose.heading)) < math.radians(5)
        assert round(lane.limit) == sign.limit


def test_every_rise_and_fall_of_the_limit_on_a_street_has_its_sign(town: RoadNetwork) -> None:
    signed = {lane_beside(town, sign)[0].id for sign in town.signs}
    changes = 0
    for lane in town.driveable:
        following = [town.lanes[id] for id in lane.successors]
        while following and all(after.internal and after.turn is None for after in following):
            following = [town.lanes[id] for inner in following for id in inner.successors]
        for after in following:
            if not after.internal and round(after.limit) != round(lane.limit):
                assert after.id in signed
                changes += 1
    assert changes >= 4


def test_posts_stand_beside_their_stop_line_where_a1_looks(town: RoadNetwork) -> None:
    for post in town.posts:
        end = end_of(town.lanes[post.lane])
        ahead, left = to_local(end, np.array([post.pose.x, post.pose.y]))
        assert abs(ahead) < 1.0
        assert A1.right + 1.0 < left < A1.left - 1.0, "half a metre off the centre line must not lose the light"
        assert abs(wrap_angle(post.pose.heading - end.heading)) < math.radians(5)


def test_stop_lines_run_across_the_end_of_the_lane_from_left_to_right(town: RoadNetwork) -> None:
    for post in town.posts:
        lane = town.lanes[post.lane]
        ends = to_local(end_of(lane), np.array(post.stop_line))
        assert ends == pytest.approx(np.array([(0, lane.width / 2), (0, -lane.width / 2)]), abs=0.02)


def test_a_post_tells_the_links_of_its_lane(town: RoadNetwork) -> None:
    for post in town.posts:
        lights = {town.lanes[id].light for id in town.lanes[post.lane].successors}
        assert lights == {(post.light, link) for link in post.links}


def test_posts_and_signs_stand_on_the_sidewalk(town: RoadNetwork) -> None:
    poses = [post.pose for post in town.posts] + [sign.pose for sign in town.signs]
    assert all(town.sidewalk.covers(shapely.Point(pose.x, pose.y)) for pose in poses)


def test_roadway_and_sidewalk_are_valid_and_do_not_overlap(town: RoadNetwork) -> None:
    assert town.roadway.is_valid
    assert town.sidewalk.is_valid
    assert town.roadway.intersection(town.sidewalk).area < 1e-6


def test_the_roadway_holds_every_lane_and_a_sidewalk_lines_every_street(town: RoadNetwork) -> None:
    for lane in town.lanes.values():
        middle = lane.line.pose_at(lane.line.length / 2)
        assert town.roadway.covers(shapely.Point(middle.x, middle.y))
        if not lane.internal:
            kerb = moved(middle, left=-(lane.width / 2 + SIDEWALK_WIDTH / 2))
            assert town.sidewalk.covers(shapely.Point(kerb.x, kerb.y)) or lane.line.length < 12


def test_bounds_enclose_the_whole_roadway(town01: RoadNetwork) -> None:
    assert town01.bounds == pytest.approx((-4, -4, 404, 334), abs=0.1)


def test_the_lane_under_a_pose_is_the_one_that_runs_its_way(town01: RoadNetwork) -> None:
    for lane in town01.driveable[:20]:
        here = moved(lane.line.pose_at(lane.line.length / 2), left=0.8)
        below, s = town01.lane_at(here)
        assert below.id == lane.id
        assert s == pytest.approx(lane.line.length / 2, abs=0.1)
        opposite, _ = town01.lane_at(moved(here, left=1.5, turn=math.pi))
        assert opposite.id != lane.id


@pytest.mark.parametrize("pose", [Pose(-500, 0, 0), Pose(200, 200, 0), Pose(180, -2, math.pi / 2)])
def test_a_pose_off_the_road_or_across_it_is_on_no_lane(pose: Pose, town01: RoadNetwork) -> None:
    with pytest.raises(ValueError, match="found no lane of town01"):
        town01.lane_at(pose)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("x", [1e308, float("nan"), float("-inf")])
def test_a_place_out_of_the_world_is_refused_before_it_is_reckoned_with(x: float, town02: RoadNetwork) -> None:
    message = r"found the place \(.*, 0\), wanted one in town02: from \(-4, -4\) to \(204, 204\)"
    with pytest.raises(ValueError, match=message):
        town02.lane_at(Pose(x, 0.0, 0.0))
    with pytest.raises(ValueError, match=message):
        town02.nearest_heading(x, 0.0)
