"""Plans drawn at random: what every one of them keeps to, whatever the seed."""

from __future__ import annotations

import itertools
import math
from collections import Counter

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from caldrive.world.roads.generated_config import CONFIGS, GeneratedTownConfig
from caldrive.world.roads.generated_plan import draw_plan
from caldrive.world.roads.plan_network import plain_network
from caldrive.world.roads.plans import Plan

SEEDS = st.integers(0, 8_999_999)
FEW = settings(max_examples=4, deadline=None)  # a plan takes a tenth of a second
KINDS = st.sampled_from(sorted(CONFIGS))


def drawn(kind: str, seed: int) -> Plan:
    """The first plan that a seed gives."""
    rng = np.random.default_rng(seed)
    return next(plan for plan in (draw_plan("town", CONFIGS[kind], rng) for _ in range(1000)) if plan is not None)


@FEW
@given(KINDS, SEEDS)
def test_the_same_seed_gives_the_same_bytes(kind: str, seed: int) -> None:
    assert plain_network(drawn(kind, seed)) == plain_network(drawn(kind, seed))


@FEW
@given(KINDS, SEEDS)
def test_three_or_four_streets_meet_at_every_junction_and_two_at_most_at_a_ring(kind: str, seed: int) -> None:
    plan = drawn(kind, seed)
    on_rings = {name for ring in plan.roundabouts for name in ring.junctions}
    ends = Counter(end for street in plan.streets for end in (street.start, street.end))
    assert set(ends) == set(plan.junctions)
    assert {n for name, n in ends.items() if name not in on_rings} <= {3, 4}
    assert {n for name, n in ends.items() if name in on_rings} <= {1}


@FEW
@given(KINDS, SEEDS)
def test_every_street_has_a_name_of_its_own_and_room_for_its_bends(kind: str, seed: int) -> None:
    plan = drawn(kind, seed)
    assert len({street.name for street in plan.streets}) == len(plan.streets)
    for street in plan.streets:
        points = np.array([plan.junctions[street.start], *street.corners, plan.junctions[street.end]])
        steps = np.diff(points, axis=0)
        lengths, headings = np.linalg.norm(steps, axis=1), np.arctan2(steps[:, 1], steps[:, 0])
        turns = np.abs((np.diff(headings) + math.pi) % math.tau - math.pi)
        for (before, after), turn in zip(itertools.pairwise(lengths), turns, strict=True):
            assert street.radius * math.tan(turn / 2) < min(before, after) / 2


@FEW
@given(KINDS, SEEDS)
def test_a_plan_keeps_to_its_settings(kind: str, seed: int) -> None:
    plan, config = drawn(kind, seed), CONFIGS[kind]
    assert config.lane_width[0] <= plan.lane_width <= config.lane_width[1]
    assert config.roundabouts[0] <= len(plan.roundabouts) <= config.roundabouts[1]
    on_rings = {name for ring in plan.roundabouts for name in ring.junctions}
    assert {street.lanes for street in plan.streets} <= {1, config.lanes}
    assert {street.lanes for street in plan.streets if {street.start, street.end} & on_rings} <= {1}
    for ring in plan.roundabouts:
        assert len(ring.junctions) == 4
        away = [math.dist(ring.center, plan.junctions[name]) for name in ring.junctions]
        assert away == pytest.approx([ring.radius] * len(away), abs=0.02)


@FEW
@given(SEEDS)
def test_lights_stand_at_the_share_of_junctions_that_is_asked_for(seed: int) -> None:
    rng = np.random.default_rng(seed)
    config = GeneratedTownConfig(lit=(0.5, 0.5))
    plan = next(plan for plan in (draw_plan("town", config, rng) for _ in range(1000)) if plan is not None)
    assert abs(len(plan.unlit) - len(plan.junctions) / 2) <= 0.5


def test_towns_differ() -> None:
    plans = [drawn("random", seed) for seed in range(8)]
    assert len({len(plan.junctions) for plan in plans}) > 2
    assert len({plan.lane_width for plan in plans}) > 5
    assert {n for plan in plans for n in Counter(e for s in plan.streets for e in (s.start, s.end)).values()} == {3, 4}
