"""Others' learners take the environment as it is, one or several."""

from __future__ import annotations

import numpy as np
import pytest
from stable_baselines3 import PPO
from stable_baselines3.common.env_checker import check_env

from caldrive.datatypes import CameraConfig
from caldrive.gym import DrivingEnv, make_env, make_vec

SMALL = CameraConfig(width=40, height=40)


@pytest.mark.parametrize("observation", ["image", "affordances"])
def test_stable_baselines_finds_nothing_to_say(observation: str) -> None:
    env = DrivingEnv(observation=observation, camera=SMALL)
    check_env(env)
    env.close()


def test_ppo_learns_in_it() -> None:
    env = DrivingEnv(observation="affordances", tasks=("straight",))
    model = PPO("MultiInputPolicy", env, n_steps=64, batch_size=32, n_epochs=1, seed=0, device="cpu")
    before = [weights.clone() for weights in model.policy.parameters()]
    model.learn(128)
    assert model.num_timesteps == 128
    assert any((a != b).any() for a, b in zip(before, model.policy.parameters(), strict=True))
    env.close()


def test_several_environments_have_processes_of_their_own_and_give_what_one_gives() -> None:
    several = make_vec("caldrive/Town01Affordances-v0", 2, tasks=("navigation-dynamic",), cars=3, people=3)
    together, _ = several.reset(seed=[4, 5])
    action = np.array([0.5, 0.0], np.float32)
    for _ in range(5):
        together, *_ = several.step(np.stack((action, action)))
    several.close()
    alone = make_env("caldrive/Town01Affordances-v0", tasks=("navigation-dynamic",), cars=3, people=3)
    observation, _ = alone.reset(seed=5)
    for _ in range(5):
        observation, *_ = alone.step(action)
    alone.close()
    for name in observation:
        assert (together[name][1] == observation[name]).all()


def test_an_unknown_id_is_said_in_one_sentence() -> None:
    with pytest.raises(ValueError, match="found environment 'caldrive/Mars-v0', wanted one of caldrive/Town01-v0"):
        make_env("caldrive/Mars-v0")
