from __future__ import annotations

import numpy as np

from caldrive.collection.start_poses import start_pose
from caldrive.datatypes import Command
from caldrive.world.roads.route import random_route
from caldrive.world.roads.towns import load_roads


def test_starts_before_signs_lie_up_the_street_and_show_every_limit() -> None:
    roads, rng = load_roads("town01"), np.random.default_rng(0)
    passed = set()
    for _ in range(60):
        start, turn = start_pose(roads, roads.signs, 1.0, 0.0, rng)
        assert turn is None
        route = random_route(roads, start, 80.0, rng)
        near = [route.line.project(sign.pose.x, sign.pose.y) for sign in roads.signs]
        ahead = [(hit.s, sign.limit) for hit, sign in zip(near, roads.signs, strict=True) if -6 < hit.left < 0]
        passed |= {limit for s, limit in ahead if 2 < s < 80}
    assert passed == {30, 60, 90}


def test_starts_are_anywhere_where_no_share_is_asked_for() -> None:
    roads, rng = load_roads("town02"), np.random.default_rng(0)
    lanes = {roads.lane_at(start_pose(roads, roads.signs, 0.0, 0.0, rng)[0])[0].id for _ in range(200)}
    assert len(lanes) > 0.7 * sum(lane.line.length > 12 for lane in roads.driveable)


def test_starts_before_turns_lie_up_the_street_and_show_every_command() -> None:
    roads, rng = load_roads("town01"), np.random.default_rng(0)
    taken = []
    for _ in range(60):
        start, turn = start_pose(roads, roads.signs, 0.0, 1.0, rng)
        assert turn is not None
        route = random_route(roads, start, 80.0, rng, through=turn)
        assert turn in [lane for lane, _ in route.lanes]
        at = route.line.project(*roads.lanes[turn].line.points[0])
        assert 0 < at.s < 60
        taken.append(roads.lanes[turn].turn)
    assert min(taken.count(command) for command in Command) > 10
