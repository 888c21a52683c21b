"""What an agent was off by, on steps whose answers are known."""

from __future__ import annotations

from dataclasses import replace

import pytest

from caldrive.datatypes import Affordances, Control, Decision, DriveState, Observation, Pose, Step, Truth, VehicleState
from caldrive.driving.behaviour import Behaviour
from caldrive.results import Infraction, InfractionKind
from tests.perception_data import column_image


def step(time: float, seen: Affordances, true: Affordances, opposite: float = 0.0) -> Step:
    observation = Observation(time, column_image(0.0), 5.0, "straight")  # type: ignore[arg-type]
    truth = Truth(time, VehicleState(Pose(5 * time, 0, 0), 5.0), true, opposite_share=opposite)
    return Step(observation, truth, Control(), Decision(Control(), seen, DriveState.CRUISING, 30.0, 20.0))


def test_errors_are_means_over_the_episode_and_over_the_seconds_before_an_infraction() -> None:
    true, behaviour = Affordances(), Behaviour()
    for k in range(100):
        wrong = replace(true, relative_angle=0.3, hazard_stop=0.9) if k >= 75 else true
        behaviour.add(step(k / 10, wrong, true))
    figures = behaviour.figures([Infraction(InfractionKind.SIDEWALK, 9.9, 0, 0)])
    assert figures["error/relative_angle"] == pytest.approx(0.3 * 0.25)
    assert figures["error/hazard_stop"] == pytest.approx(0.25)
    assert figures["before/0/relative_angle"] == pytest.approx(0.3 * 25 / 30, abs=0.011)
    assert figures["before/0/red_light"] == 0


def test_each_red_light_is_met_once_and_time_off_the_lane_counts() -> None:
    behaviour = Behaviour()
    for k in range(60):
        true = Affordances(red_light=float(k % 20 < 5))
        behaviour.add(step(k / 10, true, true, opposite=0.5 if k < 15 else 0.1))
    figures = behaviour.figures([])
    assert figures["reds_met"] == 3
    assert figures["off_lane"] == pytest.approx(0.25)
