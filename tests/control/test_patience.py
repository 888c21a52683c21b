"""A car that has stood for long goes on slowly, says so, and can be told not to."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from caldrive.control.controller import CALController, ControlConfig
from caldrive.control.longitudinal import DriveState
from caldrive.control.patience import CAR_AS_HAZARD
from caldrive.control.presets import DEFAULT, PAPER
from caldrive.datatypes import HAZARD_DISTANCE, KMH, Affordances, Command, Decision

CREEP = DEFAULT.patience.creep_speed


def act(controller: CALController, speed: float = 0.0, **affordances: Any) -> Decision:
    """A step at a speed in km/h."""
    return controller.step(Affordances(**affordances), speed * KMH, Command.STRAIGHT)


def wait(seconds: float, config: ControlConfig = DEFAULT, **affordances: Any) -> tuple[CALController, list[Decision]]:
    """What a standing car does that moves off as soon as it is let."""
    controller, results, speed = CALController(config), list[Decision](), 0.0
    for _ in range(round(seconds / 0.1)):
        results.append(act(controller, speed, **affordances))
        speed = 3.0 if results[-1].control.throttle > 0 else 0.0
    return controller, results


def test_a_hazard_that_nobody_could_be_is_passed_at_a_walking_pace() -> None:
    _, results = wait(25.0, hazard_stop=0.95, vehicle_distance=50.0)
    assert all(r.state is DriveState.HAZARD_STOP and r.control.brake == 1.0 for r in results[:149])
    assert all(r.state is DriveState.CREEPING and r.target_speed == CREEP for r in results[151:])
    assert results[-1].control.throttle > 0


def test_what_is_overridden_is_said_and_what_was_seen_stays() -> None:
    _, results = wait(20.0, hazard_stop=0.95)
    assert "hazard that has stayed for 15 s" in results[-1].note
    assert results[-1].affordances is not None
    assert results[-1].affordances.hazard_stop == 0.95
    assert "red for 25 s" in wait(25.5, red_light=0.95)[1][-1].note
    assert results[0].note == ""


def test_before_a_light_that_stays_red_the_car_rolls_on_twice_and_waits_anew() -> None:
    _, results = wait(90.0, red_light=0.95)
    stands = [r.state is DriveState.RED_LIGHT and r.control.brake >= 0.8 for r in results]
    rolls = [r.state is DriveState.CREEPING and r.target_speed == CREEP for r in results]
    assert all(stands[:249] + rolls[250:261] + stands[263:511] + rolls[514:523] + stands[526:])
    assert all(a != b for a, b in zip(stands, rolls, strict=True))
    assert sum(rolls) == 2 * 12


def test_a_light_that_looks_green_from_further_on_is_passed() -> None:
    controller, results = wait(25.5, red_light=0.95)
    green = act(controller, 3.0)
    assert (results[-1].target_speed, green.target_speed, green.state) == (CREEP, 30.0, DriveState.CRUISING)
    assert act(controller, 3.0, red_light=0.95).state is DriveState.RED_LIGHT


def test_a_red_light_that_flickers_is_waited_for_no_longer() -> None:
    controller = CALController()
    steps = [act(controller, red_light=0.3 if k % 50 == 49 else 0.9) for k in range(254)]
    assert steps[-1].state is DriveState.RED_LIGHT  # for 0.5 of these 25.4 s it was not seen
    assert [act(controller, red_light=0.9).state for _ in range(5)][-1] is DriveState.CREEPING


def test_a_moving_car_does_not_lose_its_patience() -> None:
    controller = CALController()
    assert [act(controller, 5.0, red_light=0.9).state for _ in range(900)][-1] is DriveState.RED_LIGHT


def test_after_a_hazard_is_gone_the_next_one_is_waited_for_as_long() -> None:
    controller, _ = wait(20.0, hazard_stop=0.95)
    gone = act(controller, 3.0)
    assert (gone.state, gone.target_speed) == (DriveState.CRUISING, 30.0)
    again = act(controller, 3.0, hazard_stop=0.9)
    assert (again.state, again.control.brake) == (DriveState.HAZARD_STOP, 1.0)


@pytest.mark.parametrize(
    ("config", "seen"),
    [
        (DEFAULT, {"hazard_stop": 0.9, "vehicle_distance": 6.0}),
        (PAPER, {"hazard_stop": 0.9}),
        (PAPER, {"red_light": 0.95}),
        (replace(DEFAULT, patience=replace(DEFAULT.patience, enabled=False)), {"hazard_stop": 0.9}),
        (replace(DEFAULT, patience=replace(DEFAULT.patience, enabled=False)), {"red_light": 0.9}),
    ],
)
def test_before_a_car_and_where_patience_is_off_it_waits_as_long_as_it_takes(
    config: ControlConfig, seen: dict[str, float]
) -> None:
    assert all(r.control.throttle == 0.0 and r.note == "" for r in wait(90.0, config, **seen)[1])


def test_a_red_light_holds_a_car_that_has_lost_its_patience_with_a_hazard() -> None:
    _, results = wait(24.0, hazard_stop=0.9, red_light=0.9)
    assert all(r.control.throttle == 0.0 for r in results)
    assert results[-1].state is DriveState.RED_LIGHT


def test_a_moving_car_stops_for_a_hazard_however_long_it_is_seen() -> None:
    controller = CALController()
    assert all(act(controller, 20.0, hazard_stop=0.9).control.brake == 1.0 for _ in range(200))


def test_the_car_that_is_the_hazard_is_told_by_one_distance() -> None:
    assert CAR_AS_HAZARD > HAZARD_DISTANCE  # with room for what a network misjudges
    near = wait(20.0, hazard_stop=0.9, vehicle_distance=CAR_AS_HAZARD - 0.1)[1][-1]
    far = wait(20.0, hazard_stop=0.9, vehicle_distance=CAR_AS_HAZARD)[1][-1]
    assert (near.state, far.state) == (DriveState.HAZARD_STOP, DriveState.CREEPING)
