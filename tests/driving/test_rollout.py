from __future__ import annotations

import math
from dataclasses import replace
from itertools import islice
from typing import Any

import pytest

from caldrive.agents.cal import CALAgent, OraclePerception
from caldrive.control.controller import CALController
from caldrive.control.presets import DEFAULT
from caldrive.datatypes import Affordances, Control, Observation, Pose, Step, Truth
from caldrive.driving.own_code import OwnCodeError
from caldrive.driving.rollout import rollout, run_episode
from caldrive.results import InfractionKind, Outcome
from caldrive.scenarios import Scenario
from tests.fakes import StraightRoad

SCENARIO = Scenario("straight", 1, Pose(0, 0, 0), Pose(100, 0, 0), time_limit=30)


class Idle:
    def reset(self) -> None: ...

    def act(self, observation: Observation) -> Control:
        return Control()


def driver(world: StraightRoad) -> CALAgent:
    return CALAgent(OraclePerception(world.truth), CALController(DEFAULT, world.dt))


def test_each_step_holds_what_belongs_together() -> None:
    world = StraightRoad(speed=30)
    for i, step in enumerate(islice(rollout(world, driver(world), SCENARIO), 20)):
        assert step.observation.time == step.truth.time == pytest.approx(0.1 * i)
        assert step.observation.speed == step.truth.ego.speed
        assert step.decision is not None
        assert step.decision.control == step.control


def test_the_same_scenario_drives_the_same_twice_with_one_agent() -> None:
    world = StraightRoad(signs=((50, 60),))
    agent = driver(world)
    first, second = (
        [step.truth for step in islice(rollout(world, agent, SCENARIO), 100)],
        [step.truth for step in islice(rollout(world, agent, SCENARIO), 100)],
    )
    assert first == second


def test_an_episode_ends_at_the_goal() -> None:
    world, steps = StraightRoad(), list[Step]()
    result = run_episode(world, driver(world), SCENARIO, steps.append)
    assert result.outcome is Outcome.SUCCESS
    assert result.distance == pytest.approx(98, abs=1.0)
    assert result.duration == pytest.approx(steps[-1].truth.time)
    assert result.infractions == ()
    assert result.comfort["center_distance"] < 0.01


def test_an_episode_ends_when_time_is_up() -> None:
    world = StraightRoad()
    result = run_episode(world, driver(world), replace(SCENARIO, time_limit=5))
    assert result.outcome is Outcome.TIMEOUT
    assert result.duration == pytest.approx(5, abs=0.11)


@pytest.mark.parametrize("spoilt", [{"time": 0.0}, {"time": math.nan}, {"time": math.inf}, {"ego": None}], ids=str)
def test_a_world_whose_clock_stands_still_or_whose_ego_is_nowhere_is_named(spoilt: dict[str, Any]) -> None:
    class Spoilt(StraightRoad):
        def truth(self) -> Truth:
            truth = super().truth()
            nowhere = replace(truth.ego, pose=Pose(math.nan, 0, 0))
            return replace(truth, **spoilt if "time" in spoilt else {"ego": nowhere})

    world = Spoilt()
    with pytest.raises(OwnCodeError, match=r"found that Spoilt .*correct its (step and its )?truth"):
        run_episode(world, Idle(), replace(SCENARIO, time_limit=5))


def test_a_driver_that_sees_no_red_is_caught() -> None:
    world = StraightRoad(speed=30, light=50)
    blind = CALAgent(
        OraclePerception(lambda: replace(world.truth(), affordances=Affordances())), CALController(DEFAULT)
    )
    result = run_episode(world, blind, SCENARIO)
    assert [infraction.kind for infraction in result.infractions] == [InfractionKind.RED_LIGHT]
    assert result.infractions[0].x == pytest.approx(50 - 2.1, abs=1.0)
