from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from caldrive.control.controller import SIGN_LEAVES, CALController
from caldrive.control.longitudinal import DriveState
from caldrive.control.presets import DEFAULT, PAPER
from caldrive.datatypes import Affordances, Command

ANY = st.builds(
    Affordances,
    hazard_stop=st.floats(0, 1),
    red_light=st.floats(0, 1),
    speed_sign=st.sampled_from([None, 30, 60, 90]),
    vehicle_distance=st.floats(0, 50),
    relative_angle=st.floats(-3.2, 3.2),
    center_distance=st.floats(-2, 2),
)


@pytest.mark.parametrize("config", [DEFAULT, PAPER], ids=["default", "paper"])
@given(frames=st.lists(st.tuples(ANY, st.floats(0, 30), st.sampled_from(Command)), min_size=1, max_size=20))
def test_every_control_is_lawful(config: object, frames: list[tuple[Affordances, float, Command]]) -> None:
    controller = CALController(config)  # type: ignore[arg-type]
    for affordances, speed, command in frames:
        control = controller.step(affordances, speed, command).control
        assert min(control.throttle, control.brake) == 0.0
        assert -1 <= control.steer <= 1


def limit_after(controller: CALController, sign: int | None, metres: float = 0.0) -> float | None:
    """The limit when a sign is seen, or none is, and the car has driven on so far at 5 m/s."""
    decision = controller.step(Affordances(speed_sign=sign), 5.0, Command.STRAIGHT)
    for _ in range(round(metres / (5.0 * controller.dt))):
        decision = controller.step(Affordances(), 5.0, Command.STRAIGHT)
    return decision.speed_limit


def test_a_higher_limit_counts_from_the_sign_on_which_leaves_the_view_before() -> None:
    controller = CALController(DEFAULT)
    assert limit_after(controller, 60) == 30
    assert limit_after(controller, None, metres=SIGN_LEAVES - 1.5) == 30
    assert limit_after(controller, None, metres=3.0) == 60


def test_a_lower_limit_counts_from_when_its_sign_is_seen_on() -> None:
    controller = CALController(DEFAULT)
    assert limit_after(controller, 90, metres=10.0) == 90
    assert limit_after(controller, 60) == 60
    assert limit_after(controller, None, metres=50.0) == 60


def test_cap_bounds_every_limit_and_leaves_lower_ones() -> None:
    controller = CALController(replace(DEFAULT, cap=40.0))
    assert limit_after(controller, 90, metres=10.0) == 40
    assert limit_after(controller, 30) == 30


def test_reset_starts_a_fresh_episode() -> None:
    controller = CALController(DEFAULT)
    seen = Affordances(relative_angle=0.2, center_distance=0.4)
    first = controller.step(seen, 4.0, Command.STRAIGHT)
    controller.step(Affordances(speed_sign=90, relative_angle=-0.3), 9.0, Command.LEFT)
    controller.reset()
    assert controller.step(seen, 4.0, Command.STRAIGHT) == first


@pytest.mark.parametrize("name", ["hazard_stop", "red_light", "vehicle_distance", "relative_angle", "center_distance"])
def test_brakes_blindly_where_an_affordance_is_no_number(name: str) -> None:
    controller = CALController(DEFAULT)
    steer = controller.step(Affordances(relative_angle=0.1), 5.0, Command.STRAIGHT).control.steer
    change: dict[str, Any] = {name: float("nan")}
    blind = controller.step(replace(Affordances(), **change), 5.0, Command.STRAIGHT)
    assert blind.state is DriveState.BLIND
    assert blind.control.brake > 0
    assert blind.control.steer == steer
    assert blind.note
    assert controller.step(Affordances(), 5.0, Command.STRAIGHT).state is DriveState.CRUISING
