from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from caldrive.control.lateral import LateralConfig, damped, stanley_angle, steer_angle
from caldrive.datatypes import Affordances, Command

CONFIG = LateralConfig()
ANGLES, DISTANCES, SPEEDS = st.floats(-math.pi, math.pi), st.floats(-2, 2), st.floats(0, 30)


def test_the_printed_law() -> None:
    assert stanley_angle(0.1, 0.5, 5.0, gain=1.0, floor=2.0) == pytest.approx(0.1 + math.atan(0.5 / 5))
    assert damped(0.2, 0.1, damping=0.05) == pytest.approx(0.2 - 0.05 * (0.2 - 0.1))


@pytest.mark.parametrize(
    ("command", "gain", "damping"), [(Command.LEFT, 0.5, 0.05), (Command.RIGHT, 1, 0.075), (Command.STRAIGHT, 1, 0.1)]
)
def test_each_command_has_its_gain_and_damping(command: Command, gain: float, damping: float) -> None:
    wanted = damped(0.05 + math.atan(gain * 0.3 / 6), 0.02, damping)
    found = steer_angle(Affordances(relative_angle=0.05, center_distance=0.3), 6.0, command, 0.02, CONFIG)
    assert found == pytest.approx(wanted)


@given(ANGLES, DISTANCES, SPEEDS, st.sampled_from(Command), st.floats(-0.6, 0.6))
def test_odd_symmetry_and_limit(angle: float, distance: float, speed: float, command: Command, last: float) -> None:
    left = steer_angle(Affordances(relative_angle=angle, center_distance=distance), speed, command, last, CONFIG)
    right = steer_angle(Affordances(relative_angle=-angle, center_distance=-distance), speed, command, -last, CONFIG)
    assert left == pytest.approx(-right, abs=1e-12)
    assert abs(left) <= CONFIG.max_angle


def test_line_to_the_left_or_bend_to_the_left_steers_left() -> None:
    assert steer_angle(Affordances(center_distance=0.5), 5.0, Command.STRAIGHT, 0.0, CONFIG) > 0
    assert steer_angle(Affordances(relative_angle=0.2), 5.0, Command.STRAIGHT, 0.0, CONFIG) > 0


def test_a_few_centimetres_at_standstill_do_not_throw_the_wheels_over() -> None:
    assert steer_angle(Affordances(center_distance=0.05), 0.0, Command.STRAIGHT, 0.0, CONFIG) < 0.05
