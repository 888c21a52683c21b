"""Checks of a town: each finds the fault that it is there for."""

from __future__ import annotations

from dataclasses import replace

import pytest

from caldrive.geometry import moved
from caldrive.world.roads.network import RoadNetwork
from caldrive.world.roads.road_checks import faults
from caldrive.world.scene.scenery import Prop


def test_our_own_towns_are_sound(town: RoadNetwork) -> None:
    assert list(faults(town)) == []


def test_a_lane_that_leads_nowhere_is_found(town02: RoadNetwork) -> None:
    lane = town02.driveable[0]
    broken = replace(town02, lanes=town02.lanes | {lane.id: replace(lane, successors=())})
    assert f"lane {lane.id} is not on a way round through all others" in list(faults(broken))


@pytest.mark.parametrize(("forward", "left"), [(0.0, -4.0), (9.0, 0.0), (0.0, 5.0)], ids=["off", "far", "left"])
def test_a_light_out_of_the_area_is_found(forward: float, left: float, town02: RoadNetwork) -> None:
    post = town02.posts[0]
    broken = replace(town02, posts=(replace(post, pose=moved(post.pose, forward, left)), *town02.posts[1:]))
    assert any(f"{post.id} is not seen from its lane {post.lane}" in fault for fault in faults(broken))


def test_a_light_that_others_would_obey_is_found(town02: RoadNetwork) -> None:
    post, others = town02.posts[0], town02.lanes[town02.posts[5].lane]
    strayed = replace(post, pose=others.post_beside(others.line.length))
    broken = replace(town02, posts=(strayed, *town02.posts[1:]))
    assert f"the light {post.id} is seen from lane {others.id}, for which it is not meant" in faults(broken)


def test_a_thing_on_the_road_is_found(town02: RoadNetwork, monkeypatch: pytest.MonkeyPatch) -> None:
    lane = town02.driveable[0]
    tree = Prop("tree", lane.line.pose_at(lane.line.length / 2), length=0.4, width=0.4, height=5.0)
    monkeypatch.setattr("caldrive.world.roads.road_checks.build_scenery", lambda *_: (tree,))
    assert next(faults(town02)).startswith("a tree stands on the road at (")
