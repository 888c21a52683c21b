"""The driving environment as a policy sees it: its own inputs, decisions that hold for some steps, changing tasks."""

from __future__ import annotations

from contextlib import suppress
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces

from caldrive.agents.cal import OraclePerception
from caldrive.agents.reinforcement.agent import make_eye, policy_camera
from caldrive.agents.reinforcement.config import FRAME, N_FRAMES, PolicyConfig
from caldrive.agents.reinforcement.encoder import Encoder
from caldrive.agents.reinforcement.inputs import Eye, PolicyInputs, control_of
from caldrive.agents.rows import model_path
from caldrive.datatypes import CameraConfig, Control
from caldrive.driving.rules import COLLISION
from caldrive.gym.config import EnvConfig
from caldrive.gym.env import DrivingEnv
from caldrive.interfaces import BadImage, Perception
from caldrive.perception.network.checkpoint import read_info
from caldrive.reinforcement.config import ReinforcementConfig
from caldrive.results import InfractionKind

EARLY_ENDS = (InfractionKind.SIDEWALK, InfractionKind.RED_LIGHT)
START_ACTIONS = 10  # steps of full throttle with the wheel anywhere, before the paper's RL decides
MOST = 1e6  # of a number that a policy is given: an encoder's have no bound of their own


class LearningEnv(gymnasium.Wrapper[dict[str, Any], Any, dict[str, Any], Any]):
    """A `DrivingEnv` in which a policy learns. It sees by the same `PolicyInputs` as at the wheel.

    tasks: from which an episode's is drawn; may be changed, for the next episode.
    """

    def __init__(self, env: DrivingEnv, policy: PolicyConfig, eye: Eye) -> None:
        super().__init__(env)
        self.driving, self.tasks = env, env.config.tasks
        self._policy, self._inputs = policy, PolicyInputs(eye, policy.memory)
        self.action_space, self.observation_space = env.action_space, inputs_space(policy)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Any], dict[str, Any]]:
        """Starts an episode, see `DrivingEnv.reset`."""
        _, info = self.driving.reset(seed=seed, options={"config": {"tasks": self.tasks}} | (options or {}))
        self._inputs.reset()
        if self._policy.action == "carla2017":
            self._set_off()
        return self._see(), info

    def _set_off(self) -> None:
        """Full throttle with the wheel anywhere for a second, as the paper's RL begins its episodes: by chance among
        its nine actions, of which some brake, a car hardly moves."""
        for _ in range(START_ACTIONS):
            steer = float(self.driving.np_random.uniform(-1.0, 1.0))
            if self.driving.drive_on(Control(throttle=1.0, steer=steer)):
                self.driving.reset(options={"config": {"tasks": self.tasks}})  # it was run into

    def step(self, action: Any) -> tuple[dict[str, Any], float, bool, bool, dict[str, Any]]:
        """Drives on while the decision holds, or until the episode ends; the rewards add up."""
        total, speed = 0.0, self.driving.observation.speed
        for k in range(self._policy.repeat):
            if k and self._inputs.eye.remembers:
                self._watch()
            draws = self._inputs.eye.remembers or k + 1 == self._policy.repeat
            self.driving.draw(draws)
            _, reward, terminated, truncated, info = self.driving.step(action)
            total += reward
            if terminated or truncated:
                break
        if not draws:
            self.driving.look()
        self._inputs.acted(control_of(self._policy.action, action, speed))
        if terminated and info["is_success"] and self.driving.config.reward == "roach":
            terminated, truncated = False, True  # the road goes on behind the goal, which the policy does not see
        return self._see(), total, terminated, truncated, info

    def _watch(self) -> None:
        with suppress(BadImage):  # the policy sees what it saw before; at the wheel the agent brakes
            self._inputs.watch(self.driving.observation)

    def _see(self) -> dict[str, Any]:
        self._watch()
        return self._inputs.see(self.driving.observation)


def make_learning_env(config: ReinforcementConfig, encoder: Encoder | None) -> LearningEnv:
    """An environment for a training."""
    policy, env = policy_config(config, encoder), DrivingEnv(env_config(config, encoder))
    return LearningEnv(env, policy, make_eye(policy, encoder, lambda: _perception(config, env)))


def env_config(config: ReinforcementConfig, encoder: Encoder | None) -> EnvConfig:
    """The driving that a policy learns from. Raises ValueError for a task or a reward that there is not."""
    draws = config.sees != "affordances" or config.affordances == "predicted"
    ends = (*COLLISION.values(), *(EARLY_ENDS if config.early_ends else ()))
    return EnvConfig(
        towns=config.towns, weathers=config.weathers, tasks=config.tasks, action=config.action, reward=config.reward,
        observation="image" if draws else "affordances", camera=_camera(config, encoder), ends=ends,
        leaves_route=config.early_ends,
    )  # fmt: skip


def _camera(config: ReinforcementConfig, encoder: Encoder | None) -> CameraConfig:
    """What the policy, or the network before it, looks through."""
    if config.sees != "affordances":
        return policy_camera(encoder.image_size if encoder else None)
    height, width = read_info(model_path(config.perception)).config.image_size
    return CameraConfig(width=width, height=height)


def _perception(config: ReinforcementConfig, env: DrivingEnv) -> Perception:
    """What finds the affordances that a policy learns from."""
    if config.affordances == "true":
        return OraclePerception(env.truth)
    from caldrive.perception.inference.predictor import NetworkPerception

    return NetworkPerception(model_path(config.perception), threads=1, watchdog=False)


def policy_config(config: ReinforcementConfig, encoder: Encoder | None) -> PolicyConfig:
    """The policy that a configuration trains."""
    return PolicyConfig(
        sees=config.sees, action=config.action, repeat=config.repeat, memory=config.memory, hidden=config.hidden,
        n_features=encoder.n_features if encoder else 0,
    )  # fmt: skip


def inputs_space(policy: PolicyConfig) -> spaces.Dict:
    """What a policy is given, as gymnasium's space."""
    inside: dict[str, spaces.Space[Any]] = {
        "numbers": spaces.Box(-MOST, MOST, (policy.n_numbers,), np.float32),
    }
    if policy.sees == "frames":
        inside["frames"] = spaces.Box(0, 255, (N_FRAMES, FRAME, FRAME), np.uint8)
    return spaces.Dict(inside)
