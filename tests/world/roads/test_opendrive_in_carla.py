"""What CARLA's own client makes of our maps: the same lanes, turns, lights and signs. It needs no server.

A place that the client tells has y to the right and its headings clockwise.
"""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from caldrive.datatypes import Pose
from caldrive.geometry import BLEND, Polyline, to_local, wrap_angle
from caldrive.world.roads.network import RoadNetwork
from caldrive.world.roads.opendrive_roads import OpenDriveNetwork, opendrive_roads
from caldrive.world.roads.opendrive_writer import write_opendrive
from caldrive.world.roads.towns import load_roads
from caldrive.world.roads.two_way_streets import find_streets
from caldrive.world.roads.written_signals import signals_of

carla = pytest.importorskip("carla", reason="CARLA's client has wheels up to Python 3.12")
TOWNS = ["town01", "town02", "random:11", "random-wide:11"]


@pytest.fixture(scope="module", params=TOWNS)
def roads(request: pytest.FixtureRequest) -> RoadNetwork:
    """A town."""
    if ":" in request.param:
        pytest.importorskip("sumo", reason="netconvert comes with the extra opendrive")
    return load_roads(request.param)


@pytest.fixture(scope="module")
def network(roads: RoadNetwork) -> OpenDriveNetwork:
    """Its roads by their numbers."""
    return opendrive_roads(roads)


@pytest.fixture(scope="module")
def client(roads: RoadNetwork) -> Any:
    """Its map in the client."""
    return carla.Map(roads.name, write_opendrive(roads).decode())


def pose_of(transform: Any) -> Pose:
    """A place of the client in our axes."""
    return Pose(transform.location.x, -transform.location.y, -math.radians(transform.rotation.yaw))


def waypoint(client: Any, x: float, y: float, kind: Any = None) -> Any:
    """The client's place on the nearest lane."""
    return client.get_waypoint(carla.Location(x, -y, 0.0), lane_type=kind or carla.LaneType.Driving)


def numbers(waypoints: list[Any]) -> set[tuple[int, int]]:
    """Road and lane of each."""
    return {(found.road_id, found.lane_id) for found in waypoints}


def test_every_lane_lies_where_ours_does(client: Any, network: OpenDriveNetwork, roads: RoadNetwork) -> None:
    off, turned = [], []
    for lane in roads.driveable:
        for s in np.arange(0.2, lane.line.length, 1.5).tolist():
            here = lane.line.pose_at(s)
            found = waypoint(client, here.x, here.y)
            there = pose_of(found.transform)
            assert numbers([found]) == {network.places[lane.id]}
            assert not found.is_junction
            assert found.lane_width == pytest.approx(lane.width, abs=0.01)
            off.append(abs(float(to_local(here, np.array((there.x, there.y)))[1])))
            if len(lane.line.points) == 2 or lane.line.length > 20:  # an arc of a roundabout turns 10° at each point
                turned.append(math.degrees(abs(wrap_angle(there.heading - here.heading))))
    assert max(off) < 0.05
    assert max(turned) < 1.0


def test_every_turn_follows_our_line_without_a_kink(client: Any, network: OpenDriveNetwork, roads: RoadNetwork) -> None:
    for turn, road in zip(find_streets(roads)[1], network.connecting, strict=True):
        line = Polyline(np.concatenate([lane.line.points for lane in turn.inside]))
        s = np.arange(0.05, road.length - 0.05, 0.5).tolist()
        found = [client.get_waypoint_xodr(road.id, -1, at) for at in s]
        assert {(here.is_junction, here.junction_id) for here in found} == {(True, road.junction)}
        poses = [pose_of(here.transform) for here in found]
        assert max(abs(line.project(pose.x, pose.y).left) for pose in poses) < 0.05
        bends = [abs(wrap_angle(b.heading - a.heading)) for a, b in pairwise(poses)]
        assert max(bends) < _sharpest(line) + math.radians(3)


def _sharpest(line: Polyline) -> float:
    """The sharpest bend of a polyline where its corners are rounded as ours are, rad in half a metre."""
    headings = [line.heading_at(s) for s in np.arange(0, line.length, BLEND / 4)]
    return max(abs(wrap_angle(b - a)) for a, b in zip(headings, headings[2:], strict=False))


def test_lanes_lead_where_ours_do(client: Any, network: OpenDriveNetwork, roads: RoadNetwork) -> None:
    turns = find_streets(roads)[1]
    ids = {(turn.start.id, turn.end.id): road.id for turn, road in zip(turns, network.connecting, strict=True)}
    for turn, road in zip(turns, network.connecting, strict=True):
        onward = {(ids[start, end], -1) for start, end in ids if start == turn.start.id}
        end = turn.start.line.pose_at(turn.start.line.length - 0.5)
        assert numbers(waypoint(client, end.x, end.y).next(1.0)) == onward
        assert numbers(client.get_waypoint_xodr(road.id, -1, road.length - 0.1).next(0.5)) == {
            network.places[turn.end.id]
        }
        assert numbers(client.get_waypoint_xodr(road.id, -1, 0.1).previous(0.5)) == {network.places[turn.start.id]}
    ways = sum(street.right.widths != () for street in network.streets)
    assert len(client.get_topology()) >= len(network.connecting) + ways


def test_lights_and_signs_are_landmarks_for_their_lanes(
    client: Any, network: OpenDriveNetwork, roads: RoadNetwork
) -> None:
    marks = {mark.id: mark for mark in client.get_all_landmarks()}
    signals = signals_of(roads, network)
    assert set(marks) == {signal.id for signal in signals}
    assert {post.id for signal in signals for post in signal.posts} == {post.id for post in roads.posts}
    lit = {(post.stands_at.x, post.stands_at.y): post.pose.heading for post in roads.posts}
    limited = {(sign.stands_at.x, sign.stands_at.y, sign.limit): sign.pose.heading for sign in roads.signs}
    for signal in signals:
        mark, there = marks[signal.id], pose_of(marks[signal.id].transform)
        assert mark.get_lane_validities() == [signal.lanes]
        assert mark.is_dynamic == (signal.limit is None)
        near = [
            (math.hypot(key[0] - there.x, key[1] - there.y), heading)
            for key, heading in (lit if signal.limit is None else limited).items()
            if signal.limit is None or key[2] == mark.value
        ]
        assert min(near)[0] < 0.1
        assert math.degrees(wrap_angle(min(near)[1] - there.heading)) == pytest.approx(0, abs=3)


def test_a_light_is_seen_from_its_lane_and_from_no_other(
    client: Any, network: OpenDriveNetwork, roads: RoadNetwork
) -> None:
    ids = {post.lane: signal.id for signal in signals_of(roads, network) for post in signal.posts}
    for lane in roads.driveable:
        here = lane.line.pose_at(max(lane.line.length - 8.0, 0.1))
        seen = waypoint(client, here.x, here.y).get_landmarks_of_type(10.0, "1000001", stop_at_junction=True)
        assert {mark.id for mark in seen} == ({ids[lane.id]} if lane.id in ids else set())


def test_sidewalks_lie_beside_the_roads(client: Any, roads: RoadNetwork) -> None:
    for lane in roads.driveable:
        if not roads.beside(lane):
            here = waypoint(client, *lane.line.points_at(np.array([lane.line.length / 2]))[0])
            walk = here.get_right_lane()
            assert (walk.lane_type, walk.lane_width) == (carla.LaneType.Sidewalk, pytest.approx(3.0, abs=0.01))


def test_the_lane_on_the_left_is_the_oncoming_one_and_nobody_may_change_to_it(
    client: Any, network: OpenDriveNetwork, roads: RoadNetwork
) -> None:
    two_way = {street.id for street in network.streets if street.left.widths}
    for lane in (lane for lane in roads.driveable if network.places[lane.id][0] in two_way):
        here = waypoint(client, *lane.line.points_at(np.array([lane.line.length / 2]))[0])
        if abs(here.lane_id) == 1:
            assert here.get_left_lane().lane_id == -here.lane_id
            assert not here.lane_change & carla.LaneChange.Left
            assert bool(here.lane_change & carla.LaneChange.Right) == bool(roads.beside(lane))


def test_places_become_latitudes(client: Any) -> None:
    there = client.transform_to_geolocation(carla.Location(100.0, 200.0, 0.0))
    assert (there.latitude, there.longitude) == pytest.approx((200 * 8.99e-6, 100 * 8.99e-6), rel=1e-2)
