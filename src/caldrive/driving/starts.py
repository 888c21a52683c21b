"""Where recorded episodes begin: anywhere, or before what is rare."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from caldrive.datatypes import Command, Pose, Sign
from caldrive.world.redecoration import one_of
from caldrive.world.roads import Lane, RoadNetwork

AHEAD_OF_SIGN, AHEAD_OF_TURN = (15.0, 45.0), (2.0, 25.0)  # m


def starting_place(
    roads: RoadNetwork, signs: Sequence[Sign], before_signs: float, before_turns: float, rng: np.random.Generator
) -> tuple[Pose, str | None]:
    """Anywhere on the roads, or in a share of the cases some way before a sign or a turn at a junction; each limit and
    each command gets as many of these. Returns the place, and the lane of that turn if any."""
    chance = rng.random()
    limits = sorted({sign.limit for sign in signs})
    if limits and chance < before_signs:
        limit = one_of(limits, rng)
        sign = one_of([sign for sign in signs if sign.limit == limit], rng)
        lane, at = roads.lane_at(sign.pose)
        return _upstream(roads, lane, at - float(rng.uniform(*AHEAD_OF_SIGN))), None
    turns = [lane for lane in roads.lanes.values() if lane.turn is not None]
    commands = [command for command in Command if any(lane.turn is command for lane in turns)]
    if commands and before_signs <= chance < before_signs + before_turns:
        command = one_of(commands, rng)
        turn = one_of([lane for lane in turns if lane.turn is command], rng)
        return _upstream(roads, turn, -float(rng.uniform(*AHEAD_OF_TURN))), turn.id
    lane = one_of([lane for lane in roads.driveable if lane.line.length > 12], rng)
    return lane.line.pose_at(float(rng.uniform(3, lane.line.length - 3))), None


def _upstream(roads: RoadNetwork, lane: Lane, s: float) -> Pose:
    """The place s m along a lane; where that is negative, as far up the street before it, but inside no junction."""
    before = [one for one in roads.lanes.values() if lane.id in one.successors]
    if s >= 1 or len(before) != 1 or before[0].turn is not None:
        return lane.line.pose_at(max(s, 1.0))
    return _upstream(roads, before[0], s + before[0].line.length)
