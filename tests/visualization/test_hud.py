"""The head-up display of agents that tell only a part of their reasons, or none."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from caldrive.control.longitudinal import DriveState
from caldrive.datatypes import (
    Affordances,
    Command,
    Control,
    Decision,
    Image,
    Observation,
    Pose,
    Step,
    Truth,
    VehicleState,
)
from caldrive.visualization.gauges import AMBER, BAR_LEFT, BAR_RIGHT, GREEN, LEFT, TEXT, TRUE, VALUE
from caldrive.visualization.hud import CAMERA, HEADER, OTHER_STATE, PANEL, SIGN, SIZE, STATES, Hud
from tests.visualization.pixels import count

VIEW = np.full((CAMERA.height, CAMERA.width, 3), 200, np.uint8)
WHOLE = Decision(Control(throttle=0.5), Affordances(vehicle_distance=10.0), DriveState.FOLLOWING, 60.0, 33.0, "a note")
FOLLOWING = STATES[DriveState.FOLLOWING]


def frame(decision: Decision | None, truth: bool = False) -> Image:
    """A frame of a step in which a car is really 25 m ahead."""
    ego = VehicleState(Pose(0.0, 0.0, 0.0), 5.0)
    observation = Observation(1.0, VIEW, 5.0, Command.LEFT)
    true = Truth(1.0, ego, Affordances(vehicle_distance=25.0))
    step = Step(observation, true, Control(throttle=0.5), decision)
    return Hud("a drive", 60.0, None, truth).draw(VIEW, step, [])


def panel(image: Image, left: float, right: float) -> Image:
    """Columns of the part below the camera's picture."""
    return image[CAMERA.height :, round(left) : round(right)]


def state_and_note(image: Image) -> Image:
    return image[HEADER : HEADER + 60]


def sign_and_target(image: Image) -> tuple[Image, Image]:
    column = panel(image, SIGN[0] - 24, SIGN[0] + 24)
    return column[: SIGN[1] + 10], column[SIGN[1] + 16 : SIGN[1] + 60]


def test_a_whole_decision_shows_all_its_parts() -> None:
    image = frame(WHOLE)
    sign, target = sign_and_target(image)
    assert image.shape == (SIZE[1], SIZE[0], 3)
    assert count(state_and_note(image), FOLLOWING) > 500
    assert count(panel(image, BAR_LEFT, BAR_RIGHT), AMBER) > 200
    assert count(sign, (245, 245, 245)) > 300
    assert count(target, TEXT) > 5


def test_without_affordances_the_gauges_are_empty() -> None:
    image = frame(replace(WHOLE, affordances=None))
    assert count(panel(image, BAR_LEFT, BAR_RIGHT), AMBER) == 0
    assert count(panel(image, LEFT, VALUE), TEXT) > 100  # their names stand there
    assert count(state_and_note(image), FOLLOWING) > 500


def test_without_affordances_the_truth_is_still_shown() -> None:
    without, whole, none = (
        panel(frame(decision, truth=truth), VALUE + 2, TRUE)
        for decision, truth in ((replace(WHOLE, affordances=None), True), (WHOLE, True), (WHOLE, False))
    )
    assert (without == whole).all()
    assert (without != none).any()


def test_without_a_state_there_is_no_badge_and_the_note_stays() -> None:
    image = frame(replace(WHOLE, state=None))
    assert count(state_and_note(image), FOLLOWING) == 0
    assert (state_and_note(image) != state_and_note(frame(replace(WHOLE, state=None, note="")))).any()


def test_a_state_of_the_agents_own_has_a_badge() -> None:
    assert count(state_and_note(frame(replace(WHOLE, state="looking around"))), OTHER_STATE) > 500


@pytest.mark.parametrize("limit", [None, math.inf, math.nan])
def test_without_a_limit_there_is_no_sign(limit: float | None) -> None:
    sign, target = sign_and_target(frame(replace(WHOLE, speed_limit=limit)))
    assert count(sign, (245, 245, 245)) == 0
    assert count(target, TEXT) > 5


@pytest.mark.parametrize("speed", [None, math.inf, math.nan])
def test_without_a_target_there_is_none_below_the_sign(speed: float | None) -> None:
    sign, target = sign_and_target(frame(replace(WHOLE, target_speed=speed)))
    assert count(target, TEXT) == 0
    assert count(sign, (245, 245, 245)) > 300


def test_without_a_note_only_the_badge_stands() -> None:
    image = frame(replace(WHOLE, note=""))
    assert count(state_and_note(image), FOLLOWING) > 500
    assert (state_and_note(image) != state_and_note(frame(WHOLE))).any()


def test_without_a_decision_speed_command_and_controls_are_shown() -> None:
    image = frame(None)
    assert image.shape == (SIZE[1], SIZE[0], 3)
    assert (state_and_note(image) == 200).all()
    assert count(image[-PANEL:, :LEFT], GREEN) > 500
    assert (image[-PANEL:] == frame(Decision(Control(throttle=0.5)))[-PANEL:]).all()
