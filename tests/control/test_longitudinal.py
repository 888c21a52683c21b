from __future__ import annotations

import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from caldrive.control.longitudinal import (
    DriveState,
    Longitudinal,
    LongitudinalConfig,
    Memory,
    Situation,
    cruise_target,
    follow_target,
    longitudinal_step,
)
from caldrive.control.pid import PIDState
from caldrive.control.presets import DEFAULT, PAPER
from caldrive.datatypes import Affordances, Command

PAPER_LAWS, DEFAULT_LAWS = PAPER.longitudinal, DEFAULT.longitudinal
STRAIGHT = Command.STRAIGHT
STATES = st.builds(
    Affordances,
    hazard_stop=st.floats(0, 1),
    red_light=st.floats(0, 1),
    vehicle_distance=st.floats(0, 50),
)


def decide(
    affordances: Affordances, speed: float, command: Command, limit: float, memory: Memory, laws: LongitudinalConfig
) -> Longitudinal:
    return longitudinal_step(Situation(affordances, speed, command, limit), memory, 0.1, laws)


def paper(speed: float, limit: float = 30.0, command: Command = STRAIGHT, **affordances: Any) -> Longitudinal:
    return decide(Affordances(**affordances), speed, command, limit, Memory(), PAPER_LAWS)


@pytest.mark.parametrize(
    ("speed", "limit", "brake"), [(90, 30, 0.9), (60, 30, 0.6), (46, 30, 0.46), (90, 60, 0.45), (120, 30, 1.0)]
)
def test_paper_over_limit_brakes_by_the_ratio(speed: float, limit: float, brake: float) -> None:
    result = paper(speed, limit)
    assert result.state is DriveState.OVER_LIMIT
    assert (result.throttle, result.brake) == (0.0, pytest.approx(brake))


def test_paper_is_over_limit_only_beyond_15_kmh() -> None:
    assert paper(45.0).state is DriveState.CRUISING
    assert paper(45.1).state is DriveState.OVER_LIMIT


@pytest.mark.parametrize(("speed", "brake"), [(30, 0.2), (15, 0.1), (0, 0.0), (45, 0.3)])
def test_paper_red_light_brakes_with_the_speed(speed: float, brake: float) -> None:
    result = paper(speed, red_light=0.91)
    assert result.state is DriveState.RED_LIGHT
    assert (result.throttle, result.brake) == (0.0, pytest.approx(brake))
    assert paper(speed, red_light=0.9).state is not DriveState.RED_LIGHT


def test_paper_hazard_brakes_fully_above_its_threshold() -> None:
    assert (paper(10, hazard_stop=0.71).throttle, paper(10, hazard_stop=0.71).brake) == (0.0, 1.0)
    assert paper(10, hazard_stop=0.7).state is DriveState.CRUISING


@pytest.mark.parametrize(("limit", "target"), [(30, 20), (20, 10), (60, 50), (5, 0)])
def test_paper_turns_take_10_kmh_off(limit: float, target: float) -> None:
    assert paper(0, limit, Command.LEFT).target_speed == paper(0, limit, Command.RIGHT).target_speed == target
    assert paper(0, limit).target_speed == limit


@pytest.mark.parametrize("distance", [2.0, 5.0, 10.0, 20.0, 34.9])
@pytest.mark.parametrize("limit", [20.0, 30.0, 60.0, 90.0])
def test_paper_following_law(distance: float, limit: float) -> None:
    wanted = max(0.0, limit * (1 - math.exp(-3 * distance / limit + 0.5)))
    result = paper(0.0, limit, vehicle_distance=distance)
    assert result.state is DriveState.FOLLOWING
    assert result.target_speed == pytest.approx(wanted)


def test_paper_follows_under_35_m_and_cruises_without_brake() -> None:
    assert paper(0.0, vehicle_distance=35.0).state is DriveState.CRUISING
    assert paper(40.0).brake == 0.0


@pytest.mark.parametrize("laws", [PAPER_LAWS, DEFAULT_LAWS], ids=["paper", "default"])
@given(
    affordances=STATES,
    speed=st.floats(0, 120),
    limit=st.sampled_from([0.0, 20.0, 30.0, 60.0, 90.0]),
    command=st.sampled_from(Command),
    state=st.sampled_from(DriveState),
    integral=st.floats(-1, 1),
)
def test_never_throttle_and_brake_together(
    laws: LongitudinalConfig,
    affordances: Affordances,
    speed: float,
    limit: float,
    command: Command,
    state: DriveState,
    integral: float,
) -> None:
    memory = Memory(state, PIDState(integral))
    result = decide(affordances, speed, command, limit, memory, laws)
    assert 0 <= result.throttle <= 1
    assert 0 <= result.brake <= 1
    assert result.throttle == 0 or result.brake == 0
    assert 0 <= result.target_speed <= limit


@pytest.mark.parametrize("laws", [PAPER_LAWS, DEFAULT_LAWS], ids=["paper", "default"])
def test_the_most_important_state_wins(laws: LongitudinalConfig) -> None:
    layers = [
        (DriveState.CRUISING, {}, 20.0),
        (DriveState.FOLLOWING, {"vehicle_distance": 20.0}, 20.0),
        (DriveState.OVER_LIMIT, {}, 60.0),
        (DriveState.RED_LIGHT, {"red_light": 1.0}, 60.0),
        (DriveState.HAZARD_STOP, {"hazard_stop": 1.0}, 60.0),
    ]
    seen: dict[str, Any] = {}
    for state, change, speed in layers:
        seen |= change
        assert decide(Affordances(**seen), speed, STRAIGHT, 30.0, Memory(), laws).state is state


@given(st.floats(0, 50), st.floats(0, 50), st.sampled_from([20.0, 30.0, 60.0, 90.0]))
def test_following_is_faster_the_farther_the_car(one: float, other: float, limit: float) -> None:
    near, far = sorted((one, other))
    assert follow_target(near, limit, DEFAULT_LAWS) <= follow_target(far, limit, DEFAULT_LAWS) <= limit


def test_default_turns_at_15_kmh_or_the_limit() -> None:
    assert [cruise_target(limit, Command.LEFT, DEFAULT_LAWS) for limit in (10, 20, 30, 60)] == [10, 15, 15, 15]


def test_default_holds_the_brake_at_standstill() -> None:
    for affordances in (Affordances(vehicle_distance=5.0), Affordances(red_light=1.0), Affordances(hazard_stop=1.0)):
        assert decide(affordances, 0.0, STRAIGHT, 30.0, Memory(), DEFAULT_LAWS).brake >= 0.3


def test_too_fast_behind_a_car_brakes_for_the_car() -> None:
    near = decide(Affordances(vehicle_distance=8.0), 34.0, STRAIGHT, 30.0, Memory(), DEFAULT_LAWS)
    alone = decide(Affordances(), 34.0, STRAIGHT, 30.0, Memory(), DEFAULT_LAWS)
    assert near.state is alone.state is DriveState.OVER_LIMIT
    assert near.brake > 0.8 > 0.2 > alone.brake > 0.0


def test_cruising_hands_its_throttle_to_following_but_not_to_a_stop() -> None:
    cruising = Memory(DriveState.CRUISING, PIDState(0.25, error=12.0, derivative=-40.0))
    at_target = follow_target(30.0, 30.0, DEFAULT_LAWS)
    follow = decide(Affordances(vehicle_distance=30.0), at_target, STRAIGHT, 30.0, cruising, DEFAULT_LAWS)
    assert follow.throttle == pytest.approx(0.25)
    stop = decide(Affordances(hazard_stop=1.0), 20.0, STRAIGHT, 30.0, cruising, DEFAULT_LAWS)
    assert stop.memory.pid == PIDState()
