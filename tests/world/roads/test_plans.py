"""Plans of the towns: rounded corners, limits along a street, and the networks that ship."""

from __future__ import annotations

import itertools
import math
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from caldrive.world.roads import plans
from caldrive.world.roads.plan_network import network_of
from caldrive.world.roads.plans import AFTER_JUNCTION, PLANS, Plan, limits, rounded
from caldrive.world.roads.towns import load_roads

STRETCH = st.floats(20.0, 400.0)


def test_a_rounded_right_angle_is_shorter_by_what_a_quarter_circle_saves() -> None:
    line, bends = rounded(np.array([(0.0, 0.0), (50.0, 0.0), (50.0, 70.0)]), 20.0)
    length = np.linalg.norm(np.diff(line, axis=0), axis=1).sum()
    assert length == pytest.approx(120 - 2 * 20 + 20 * math.pi / 2, abs=0.02)
    assert bends == [pytest.approx((30.0, 30.0 + 20 * math.pi / 2))]


@pytest.mark.parametrize("side", [1, -1], ids=["left", "right"])
def test_a_rounded_corner_lies_on_a_circle_whose_centre_is_inside_the_bend(side: int) -> None:
    line, _ = rounded(np.array([(0.0, 0.0), (50.0, 0.0), (50.0, side * 70.0)]), 20.0)
    distances = np.linalg.norm(line[1:-1] - (30.0, side * 20.0), axis=1)
    assert distances == pytest.approx(np.full(len(distances), 20.0))


def test_a_line_without_corners_stays_as_it_is() -> None:
    line, bends = rounded(np.array([(0.0, 0.0), (50.0, 0.0)]), 20.0)
    assert line.tolist() == [[0, 0], [50, 0]]
    assert bends == []


@given(st.lists(STRETCH, min_size=1, max_size=4))
def test_limits_rise_by_30_at_most_and_every_stretch_ends_with_30(stretches: list[float]) -> None:
    bends, s = [], 0.0
    for stretch in stretches[:-1]:
        bends.append((s + stretch, s + stretch + 31.4))
        s += stretch + 31.4
    profile = limits(s + stretches[-1], bends)
    starts, values = zip(*profile, strict=True)
    assert list(starts) == sorted(set(starts))
    assert all(after - before <= 30 for before, after in itertools.pairwise(values))
    assert values[0] == values[-1] == 30
    for begin, _ in bends:
        assert [limit for start, limit in profile if start <= begin][-1] == 30


def test_a_short_street_keeps_to_30_and_a_long_one_reaches_90() -> None:
    assert limits(80.0, []) == [(0.0, 30)]
    assert {limit for _, limit in limits(120.0, [])} == {30, 60}
    assert {limit for _, limit in limits(260.0, [])} == {30, 60, 90}


def test_a_higher_limit_begins_only_where_the_junction_is_left_behind() -> None:
    assert limits(260.0, [])[1] == (AFTER_JUNCTION, 60)


@pytest.mark.parametrize("plan", PLANS.values(), ids=PLANS)
def test_three_streets_meet_at_every_junction(plan: Plan) -> None:
    ends = Counter(end for street in plan.streets for end in (street.start, street.end))
    assert ends == dict.fromkeys(plan.junctions, 3)


@pytest.mark.parametrize("plan", PLANS.values(), ids=PLANS)
def test_a_plan_made_anew_gives_the_bytes_that_ship(plan: Plan) -> None:
    pytest.importorskip("sumo", reason="netconvert comes with the extra opendrive")
    shipped = Path(plans.__file__).parent / "data" / f"{plan.name}.net.xml"
    assert network_of(plan) == shipped.read_bytes()


@pytest.mark.parametrize("plan", PLANS.values(), ids=PLANS)
def test_every_junction_of_a_plan_has_its_light(plan: Plan) -> None:
    assert {post.light for post in load_roads(plan.name).posts} == set(plan.junctions)
