"""Streets: both directions together, from junction to junction."""

from __future__ import annotations

import math

import pytest

from caldrive.datatypes import Command
from caldrive.geometry import moved
from caldrive.world.roads.network import RoadNetwork
from caldrive.world.roads.plans import TOWN01, TOWN02, Plan
from caldrive.world.roads.towns import load_roads
from caldrive.world.roads.two_way_streets import find_streets

needs_netconvert = pytest.mark.skipif(
    not pytest.importorskip("importlib.util").find_spec("sumo"), reason="netconvert comes with the extra opendrive"
)


@pytest.mark.parametrize("plan", [TOWN01, TOWN02], ids=lambda plan: plan.name)
def test_each_street_of_the_plan_is_one_with_both_directions(plan: Plan) -> None:
    roads = load_roads(plan.name)
    streets, _ = find_streets(roads)
    assert len(streets) == len(plan.streets)
    assert all(len(street.ahead) == len(street.back) for street in streets)
    assert sum(len(street.ahead) + len(street.back) for street in streets) == len(roads.driveable)


def test_the_directions_of_a_street_share_its_middle(town01: RoadNetwork) -> None:
    for street in find_streets(town01)[0]:
        for edge, opposite in zip(street.ahead, reversed(street.back), strict=True):
            end, start = (
                moved(lane.line.pose_at(s), left=2.0)
                for lane, s in ((edge[0], edge[0].line.length), (opposite[0], 0.0))
            )
            assert math.hypot(end.x - start.x, end.y - start.y) < 0.2


def test_a_junction_of_three_streets_has_six_turns(town02: RoadNetwork) -> None:
    _, turns = find_streets(town02)
    assert len(turns) == 6 * len(TOWN02.junctions)
    assert {turn.inside[0].turn for turn in turns} == {*Command}
    assert all(turn.inside[-1].successors == (turn.end.id,) for turn in turns)


@needs_netconvert
def test_the_arcs_of_a_roundabout_are_one_way_and_streets_of_two_lanes_stay_together() -> None:
    streets, turns = find_streets(load_roads("random-wide:11"))
    one_way = [street for street in streets if not street.back]
    assert one_way
    assert len(one_way) % 4 == 0
    assert {len(edge) for street in streets for edge in (*street.ahead, *street.back)} == {1, 2}
    assert all(len(set(map(len, street.ahead))) == 1 for street in streets)
    assert len({(turn.start.id, turn.end.id) for turn in turns}) == len(turns)
