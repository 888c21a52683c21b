"""Blind drivers: an affordance is held at its default, and who needs it fails."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from caldrive.affordances import BY_NAME
from caldrive.agents.blind import BlindPerception, blinded
from caldrive.agents.cal import CALAgent, OraclePerception
from caldrive.control.controller import CALController, ControlConfig
from caldrive.datatypes import Affordances, Command, Observation, Pose
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
    predicted = BlindPerception(Seer(), [name]).predict(ANYTHING)
    assert getattr(predicted, name) == getattr(Affordances(), name)
    assert all(getattr(predicted, other) == getattr(SEEN, other) for other in BY_NAME if other != name)


@pytest.mark.parametrize(("blind", "run"), [((), 0), (("red_light",), 1), (("hazard_stop", "speed_sign"), 0)])
def test_who_does_not_see_red_lights_runs_them(blind: tuple[str, ...], run: int) -> None:
    world = StraightRoad(light=60.0, green_at=30.0)
    agent = CALAgent(OraclePerception(world.truth), CALController(ControlConfig(cap=30.0), world.dt))
    scenario = Scenario("straight", 1, Pose(0, 0, 0), Pose(100, 0, 0), time_limit=40.0)
    result = run_episode(world, blinded(agent, blind), scenario)
    assert [i.kind for i in result.infractions] == [InfractionKind.RED_LIGHT] * run


def test_only_affordances_that_there_are_can_be_left_out() -> None:
    with pytest.raises(ValueError, match=r"found affordance 'lights', wanted one of hazard_stop, .*type --blind"):
        blinded(CALAgent(Seer(), CALController(ControlConfig(), 0.1)), ["lights"])


def test_an_agent_without_a_perception_cannot_be_blind() -> None:
    class Cruiser:
        def reset(self) -> None:
            """Nothing to forget."""

        act: Any = None

    with pytest.raises(ValueError, match=r"found that Cruiser has no perception .*leave --blind out"):
        blinded(Cruiser(), ["hazard_stop"])
    assert blinded(cruiser := Cruiser(), []) is cruiser


def test_the_command_line_takes_it_more_than_once(tmp_path: Path) -> None:
    report = run_json(
        *("drive", "--agent", "oracle", "--blind", "red_light", "--blind", "hazard_stop", "--seconds", "1"),
        *("--no-video", "--out", str(tmp_path)),
    )
    assert report["episodes"][0]["outcome"] == "timeout"
    refused = run_json("benchmark", "--blind", "lights", "--out", str(tmp_path / "run"), code=2)
    assert "found affordance 'lights'" in refused["error"]
    assert not (tmp_path / "run").exists()
