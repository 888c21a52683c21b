from __future__ import annotations

import pickle
from dataclasses import FrozenInstanceError

import pytest
from hypothesis import given
from hypothesis import strategies as st

from caldrive.control.longitudinal import DriveState
from caldrive.datatypes import MAX_VEHICLE_DISTANCE, Affordances, Control, Pose
from caldrive.results import Outcome


@given(st.floats(0, 1), st.floats(0, 1), st.floats(-1, 1))
def test_every_control_in_range_is_accepted(throttle: float, brake: float, steer: float) -> None:
    control = Control(throttle, brake, steer)
    assert (control.throttle, control.brake, control.steer) == (throttle, brake, steer)


@pytest.mark.parametrize(
    ("name", "value"),
    [("throttle", -0.1), ("throttle", 1.1), ("brake", -0.1), ("brake", 2.0), ("steer", -1.1), ("steer", float("nan"))],
)
def test_a_control_out_of_range_says_which_and_what_to_do(name: str, value: float) -> None:
    with pytest.raises(ValueError, match=rf"{name} is .*must lie in .*clip it"):
        Control(**{name: value})


def test_an_empty_road_is_the_default() -> None:
    assert Affordances() == Affordances(0.0, 0.0, None, MAX_VEHICLE_DISTANCE, 0.0, 0.0)


def test_values_are_frozen_hashable_and_travel_between_processes() -> None:
    pose = Pose(1.0, 2.0, 0.5)
    with pytest.raises(FrozenInstanceError):
        pose.x = 3.0  # type: ignore[misc]
    assert hash(pose) == hash(Pose(1.0, 2.0, 0.5))
    assert pickle.loads(pickle.dumps(pose)) == pose


def test_states_are_in_ascending_importance() -> None:
    names = [state.value for state in DriveState]
    assert names == ["cruising", "following", "over limit", "red light", "hazard stop", "creeping", "blind"]


def test_outcomes_read_as_messages() -> None:
    assert f"The car {Outcome.SUCCESS.value}." == "The car reached the goal in time."
