"""What a policy sees while it learns is what it sees at the wheel."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from caldrive.agents.cal import OraclePerception
from caldrive.agents.reinforcement.agent import ReinforcementAgent
from caldrive.agents.reinforcement.inputs import AffordanceEye, FrameEye, Inputs
from caldrive.agents.reinforcement.policy import Policy
from caldrive.datatypes import DT, Control, Observation
from caldrive.reinforcement.config import REINFORCEMENTS
from caldrive.reinforcement.environment import START_ACTIONS, policy_config
from tests.reinforcement.data import ROAD, make_env, straight_road

__all__ = ["straight_road"]
pytestmark = pytest.mark.usefixtures("straight_road")


@pytest.mark.filterwarnings("ignore:.*different from the unwrapped version")
@pytest.mark.parametrize("preset", ["paper", "affordances"])
def test_it_keeps_gymnasiums_contract(preset: str) -> None:
    check_env(make_env(REINFORCEMENTS[preset]), skip_render_check=True)


@pytest.mark.parametrize("preset", ["paper", "affordances"])
def test_the_inputs_in_training_are_those_at_the_wheel(preset: str) -> None:
    config = replace(REINFORCEMENTS[preset], hidden=8)
    policy = Policy(policy_config(config, None))
    env = make_env(config)
    eye = FrameEye() if preset == "paper" else AffordanceEye(OraclePerception(env.driving.truth))
    agent = ReinforcementAgent(policy, eye)
    given: list[Inputs] = []
    see = agent.inputs.see

    def noted(observation: Observation) -> Inputs:
        given.append(see(observation))
        return given[-1]

    agent.inputs.see = noted  # type: ignore[method-assign]
    seen, _ = env.reset(seed=1, options={"scenario": ROAD})
    agent.reset()
    for _ in range(6):
        agent._held = 0
        control = agent.act(env.driving.observation)
        assert given[-1].keys() == seen.keys()
        assert all((given[-1][name] == seen[name]).all() for name in seen)
        action = action_of(control) if preset == "affordances" else 4
        agent.inputs.acted(control if preset == "affordances" else Control(throttle=1.0))
        seen, *_ = env.step(action)


def action_of(control: Control) -> np.ndarray:
    return np.array([control.throttle - control.brake, control.steer], np.float32)


def test_a_decision_holds_and_its_rewards_add_up() -> None:
    config = REINFORCEMENTS["affordances"]
    once, thrice = make_env(replace(config, repeat=1)), make_env(replace(config, repeat=3))
    for env in (once, thrice):
        env.reset(options={"scenario": ROAD})
    action = np.array([1.0, 0.0], np.float32)
    single = [once.step(action) for _ in range(3)]
    seen, reward, *_ = thrice.step(action)
    assert reward == pytest.approx(sum(step[1] for step in single))
    assert (seen["numbers"] == single[-1][0]["numbers"]).all()


@pytest.mark.parametrize("steps", [2, 3])
def test_pictures_that_nobody_sees_are_not_drawn(steps: int) -> None:
    """The road ends at a time limit, within a decision or with it."""
    config = replace(REINFORCEMENTS["paper"], repeat=2)
    scenario = replace(ROAD, time_limit=DT * (START_ACTIONS + steps))
    sparing, lavish = make_env(config), make_env(config)
    lavish.driving.draw = lambda draws: None  # type: ignore[method-assign]
    for env in (sparing, lavish):
        env.reset(seed=1, options={"scenario": scenario})
    ended = False
    while not ended:
        (seen, *_, ended, _), (expected, *_) = sparing.step(0), lavish.step(0)
        assert (seen["frames"] == expected["frames"]).all()
        assert seen["frames"].any()
    drawn = [env.driving._world.drawn for env in (sparing, lavish)]  # type: ignore[union-attr]
    assert drawn[0] < drawn[1]


def test_the_last_decision_is_seen() -> None:
    env = make_env(REINFORCEMENTS["affordances"])
    env.reset(options={"scenario": ROAD})
    seen, *_ = env.step(np.array([-0.5, 0.25], np.float32))
    assert seen["numbers"][10:12].tolist() == [-0.5, 0.25]


def test_beside_its_route_it_ends_with_a_penalty() -> None:
    env = make_env(REINFORCEMENTS["affordances"])
    env.reset(options={"scenario": ROAD})
    ended, rewards = False, []
    while not ended:
        _, reward, ended, truncated, info = env.step(np.array([0.6, 0.5], np.float32))
        rewards.append(reward)
        assert not truncated
    assert info["left_route"]
    assert min(rewards[:-1]) > rewards[-1]


def test_its_tasks_may_change_for_the_next_episode() -> None:
    env = make_env(REINFORCEMENTS["affordances"])
    env.tasks = ("one-turn",)
    assert env.reset()[1]["task"] == "one-turn"
