from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from caldrive.config import LongitudinalConfig
from caldrive.control.longitudinal import Longitudinal, Memory, cruise_target, follow_target, longitudinal_step
from caldrive.control.pid import PIDState
from caldrive.control.presets import DEFAULT, PAPER
from caldrive.datatypes import Affordances, Command, DriveState

PAPER_LAWS, DEFAULT_LAWS = PAPER.longitudinal, DEFAULT.longitudinal
STRAIGHT = Command.STRAIGHT
STATES = st.builds(
    Affordances,
    hazard_stop=st.floats(0, 1),
    red_light=st.floats(0, 1),
    vehicle_distance=st.floats(0, 50),
)


def paper(speed: float, limit: float = 30.0, command: Command = STRAIGHT, **affordances: float) -> Longitudinal:
    return longitudinal_step(Affordances(**affordances), speed, command, limit, Memory(), 0.1, PAPER_LAWS)


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
    result = longitudinal_step(affordances, speed, command, limit, memory, 0.1, laws)
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
    seen: dict[str, float] = {}
    for state, change, speed in layers:
        seen |= change
        assert longitudinal_step(Affordances(**seen), speed, STRAIGHT, 30.0, Memory(), 0.1, laws).state is state


@given(st.floats(0, 50), st.floats(0, 50), st.sampled_from([20.0, 30.0, 60.0, 90.0]))
def test_following_is_faster_the_farther_the_car(one: float, other: float, limit: float) -> None:
    near, far = sorted((one, other))
    assert follow_target(near, limit, DEFAULT_LAWS) <= follow_target(far, limit, DEFAULT_LAWS) <= limit


def test_default_turns_at_15_kmh_or_the_limit() -> None:
    assert [cruise_target(limit, Command.LEFT, DEFAULT_LAWS) for limit in (10, 20, 30, 60)] == [10, 15, 15, 15]


def test_default_holds_the_brake_at_standstill() -> None:
    for affordances in (Affordances(vehicle_distance=5.0), Affordances(red_light=1.0), Affordances(hazard_stop=1.0)):
        assert longitudinal_step(affordances, 0.0, STRAIGHT, 30.0, Memory(), 0.1, DEFAULT_LAWS).brake >= 0.3


def test_too_fast_behind_a_car_brakes_for_the_car() -> None:
    near = longitudinal_step(Affordances(vehicle_distance=8.0), 34.0, STRAIGHT, 30.0, Memory(), 0.1, DEFAULT_LAWS)
    alone = longitudinal_step(Affordances(), 34.0, STRAIGHT, 30.0, Memory(), 0.1, DEFAULT_LAWS)
    assert near.state is alone.state is DriveState.OVER_LIMIT
    assert near.brake > 0.8 > 0.2 > alone.brake > 0.0


def test_cruising_hands_its_throttle_to_following_but_not_to_a_stop() -> None:
    cruising = Memory(DriveState.CRUISING, PIDState(0.25, error=12.0, derivative=-40.0))
    at_target = follow_target(30.0, 30.0, DEFAULT_LAWS)
    follow = longitudinal_step(
        Affordances(vehicle_distance=30.0), at_target, STRAIGHT, 30.0, cruising, 0.1, DEFAULT_LAWS
    )
    assert follow.throttle == pytest.approx(0.25)
    stop = longitudinal_step(Affordances(hazard_stop=1.0), 20.0, STRAIGHT, 30.0, cruising, 0.1, DEFAULT_LAWS)
    assert stop.memory.pid == PIDState()


def wait(seconds: float, laws: LongitudinalConfig, **affordances: float) -> list[Longitudinal]:
    """What a standing car does that moves off as soon as it is let."""
    results, memory, speed = [], Memory(), 0.0
    for _ in range(round(seconds / 0.1)):
        results.append(longitudinal_step(Affordances(**affordances), speed, STRAIGHT, 30.0, memory, 0.1, laws))
        memory, speed = results[-1].memory, 3.0 if results[-1].throttle > 0 else 0.0
    return results


def test_a_hazard_that_nobody_could_be_is_passed_at_a_walking_pace() -> None:
    results = wait(25.0, DEFAULT_LAWS, hazard_stop=0.95, vehicle_distance=50.0)
    assert all(r.state is DriveState.HAZARD_STOP and r.brake == 1.0 for r in results[:149])
    assert all(r.state is DriveState.CRUISING and r.target_speed == 4.0 for r in results[151:])
    assert results[-1].throttle > 0


def test_before_a_light_that_stays_red_the_car_rolls_on_twice_and_waits_anew() -> None:
    results = wait(90.0, DEFAULT_LAWS, red_light=0.95)
    stands = [r.state is DriveState.RED_LIGHT and r.brake >= 0.8 for r in results]
    rolls = [r.state is DriveState.CRUISING and r.target_speed == 4.0 for r in results]
    assert all(stands[:249] + rolls[250:261] + stands[263:511] + rolls[514:523] + stands[526:])
    assert all(a != b for a, b in zip(stands, rolls, strict=True))
    assert sum(rolls) == 2 * 12


def test_a_light_that_looks_green_from_further_on_is_passed() -> None:
    rolling = wait(25.5, DEFAULT_LAWS, red_light=0.95)[-1]
    green = longitudinal_step(Affordances(), 3.0, STRAIGHT, 30.0, rolling.memory, 0.1, DEFAULT_LAWS)
    assert (rolling.target_speed, green.target_speed) == (4.0, 30.0)
    assert (green.memory.waited_red, green.memory.rolls) == (0.0, 0)


def test_a_red_light_that_flickers_is_waited_for_no_longer() -> None:
    memory = Memory()
    for k in range(254):
        seen = Affordances(red_light=0.3 if k % 50 == 49 else 0.9)
        step = longitudinal_step(seen, 0.0, STRAIGHT, 30.0, memory, 0.1, DEFAULT_LAWS)
        memory = step.memory
    assert (step.state, step.target_speed) == (DriveState.RED_LIGHT, 0.0)  # for 0.5 of these 25.4 s it was not seen
    for _ in range(5):
        step = longitudinal_step(seen, 0.0, STRAIGHT, 30.0, memory, 0.1, DEFAULT_LAWS)
        memory = step.memory
    assert (step.state, step.target_speed) == (DriveState.CRUISING, 4.0)


def test_a_moving_car_does_not_lose_its_patience() -> None:
    memory = Memory()
    for _ in range(900):
        step = longitudinal_step(Affordances(red_light=0.9), 5.0, STRAIGHT, 30.0, memory, 0.1, DEFAULT_LAWS)
        memory = step.memory
    assert step.state is DriveState.RED_LIGHT


def test_after_a_hazard_is_gone_the_next_one_is_waited_for_as_long() -> None:
    before = wait(20.0, DEFAULT_LAWS, hazard_stop=0.95)[-1]
    gone = longitudinal_step(Affordances(), 3.0, STRAIGHT, 30.0, before.memory, 0.1, DEFAULT_LAWS)
    assert (gone.state, gone.target_speed, gone.memory.waited) == (DriveState.CRUISING, 30.0, 0.0)
    again = longitudinal_step(Affordances(hazard_stop=0.9), 3.0, STRAIGHT, 30.0, gone.memory, 0.1, DEFAULT_LAWS)
    assert (again.state, again.brake) == (DriveState.HAZARD_STOP, 1.0)


@pytest.mark.parametrize(
    ("laws", "seen"),
    [
        (DEFAULT_LAWS, {"hazard_stop": 0.9, "vehicle_distance": 6.0}),
        (PAPER_LAWS, {"hazard_stop": 0.9}),
        (PAPER_LAWS, {"red_light": 0.95}),
    ],
)
def test_before_a_car_and_with_the_papers_laws_it_waits_as_long_as_it_takes(
    laws: LongitudinalConfig, seen: dict[str, float]
) -> None:
    assert all(r.throttle == 0.0 for r in wait(90.0, laws, **seen))


def test_a_red_light_holds_a_car_that_has_lost_its_patience_with_a_hazard() -> None:
    assert all(r.throttle == 0.0 for r in wait(24.0, DEFAULT_LAWS, hazard_stop=0.9, red_light=0.9))


def test_a_moving_car_stops_for_a_hazard_however_long_it_is_seen() -> None:
    memory = Memory()
    for _ in range(200):
        result = longitudinal_step(Affordances(hazard_stop=0.9), 20.0, STRAIGHT, 30.0, memory, 0.1, DEFAULT_LAWS)
        memory = result.memory
        assert result.brake == 1.0
