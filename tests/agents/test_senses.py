"""Drivers who are blind to an affordance, and fail where they need it, and those who are told the truth."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from caldrive.affordances import BY_NAME
from caldrive.agents.cal import CALAgent, OraclePerception
from caldrive.agents.senses import OtherSenses, with_senses
from caldrive.control.controller import CALController, ControlConfig
from caldrive.datatypes import Affordances, Command, Observation, Pose, Truth, VehicleState
from caldrive.driving.rollout import run_episode
from caldrive.results import InfractionKind
from caldrive.scenarios import Scenario
from tests.command_line import run_json
from tests.fakes import StraightRoad

SEEN = Affordances(
    hazard_stop=1.0, red_light=1.0, speed_sign=30, vehicle_distance=7.0, relative_angle=0.2, center_distance=1.0
)
ANYTHING = Observation(0.0, np.zeros((1, 1, 3), np.uint8), 5.0, Command.STRAIGHT)


class Seer:
    """Sees SEEN."""

    def reset(self) -> None:
        """Nothing to forget."""

    def predict(self, observation: Observation) -> Affordances:
        return SEEN


@pytest.mark.parametrize("name", BY_NAME)
def test_what_is_not_seen_is_at_its_default_and_the_rest_is_as_it_was(name: str) -> None:
    predicted = OtherSenses(Seer(), [name]).predict(ANYTHING)
    assert getattr(predicted, name) == getattr(Affordances(), name)
    assert all(getattr(predicted, other) == getattr(SEEN, other) for other in BY_NAME if other != name)


@pytest.mark.parametrize(("blind", "run"), [((), 0), (("red_light",), 1), (("hazard_stop", "speed_sign"), 0)])
def test_who_does_not_see_red_lights_runs_them(blind: tuple[str, ...], run: int) -> None:
    world = StraightRoad(light=60.0, green_at=30.0)
    agent = CALAgent(OraclePerception(world.truth), CALController(ControlConfig(cap=30.0), world.dt))
    scenario = Scenario("straight", 1, Pose(0, 0, 0), Pose(100, 0, 0), time_limit=40.0)
    result = run_episode(world, with_senses(agent, blind), scenario)
    assert [i.kind for i in result.infractions] == [InfractionKind.RED_LIGHT] * run


@pytest.mark.parametrize("name", BY_NAME)
def test_what_is_told_is_true_and_the_rest_is_as_it_was_seen(name: str) -> None:
    true = Affordances(0.0, 0.0, 90, 20.0, -0.1, -0.5)
    truth = Truth(0.0, VehicleState(Pose(0, 0, 0)), true)
    told = OtherSenses(Seer(), truth=[name], truth_source=lambda: truth).predict(ANYTHING)
    assert getattr(told, name) == getattr(true, name)
    assert all(getattr(told, other) == getattr(SEEN, other) for other in BY_NAME if other != name)
    assert OtherSenses(Seer(), truth=list(BY_NAME), truth_source=lambda: truth).predict(ANYTHING) == true


def test_a_driver_who_sees_nothing_but_is_told_of_red_lights_stops_for_them() -> None:
    world = StraightRoad(light=60.0, green_at=30.0)
    agent = CALAgent(OraclePerception(world.truth), CALController(ControlConfig(cap=30.0), world.dt))
    others = [name for name in BY_NAME if name != "red_light"]
    scenario = Scenario("straight", 1, Pose(0, 0, 0), Pose(100, 0, 0), time_limit=40.0)
    result = run_episode(world, with_senses(agent, others, ["red_light"], world.truth), scenario)
    assert not result.infractions


def test_nobody_is_blind_to_what_he_is_told() -> None:
    with pytest.raises(ValueError, match="found red_light in --blind and in --truth"):
        with_senses(CALAgent(Seer(), CALController(ControlConfig(), 0.1)), ["red_light"], ["red_light"])


def test_only_affordances_that_there_are_can_be_left_out() -> None:
    with pytest.raises(ValueError, match=r"found affordance 'lights', wanted one of hazard_stop, .*type --blind"):
        with_senses(CALAgent(Seer(), CALController(ControlConfig(), 0.1)), ["lights"])


def test_an_agent_without_a_perception_cannot_be_blind() -> None:
    class Cruiser:
        def reset(self) -> None:
            """Nothing to forget."""

        act: Any = None

    with pytest.raises(ValueError, match=r"found that Cruiser has no perception .*leave --blind out"):
        with_senses(Cruiser(), ["hazard_stop"])
    assert with_senses(cruiser := Cruiser(), []) is cruiser


def test_the_command_line_takes_it_more_than_once(tmp_path: Path) -> None:
    report = run_json(
        *("drive", "--agent", "oracle", "--blind", "red_light", "--blind", "hazard_stop", "--seconds", "1"),
        *("--no-video", "--out", str(tmp_path)),
    )
    assert report["episodes"][0]["outcome"] == "timeout"
    refused = run_json("benchmark", "--blind", "lights", "--out", str(tmp_path / "run"), code=2)
    assert "found affordance 'lights'" in refused["error"]
    assert not (tmp_path / "run").exists()
