"""The policy inside stable-baselines3: our own network, with an estimate of the value beside it."""

from __future__ import annotations

from typing import Any

from stable_baselines3.common.policies import BasePolicy
from torch import Tensor, nn
from torch.optim import Adam

from caldrive.agents.reinforcement.config import PolicyConfig
from caldrive.agents.reinforcement.policy import Policy, trunk

Inputs = dict[str, Tensor]
ADAM_EPSILON = 1e-5  # Engstrom et al. 2020, of PPO's details


class LearningPolicy(BasePolicy):
    """A `Policy` and its value. A policy with convolutions shares them with the value, as in the paper; one on numbers
    does not."""

    def __init__(
        self, observation_space: Any, action_space: Any, schedule: Any, config: PolicyConfig, **_: Any
    ) -> None:
        super().__init__(observation_space, action_space)
        self.actor = Policy(config)
        self.below_value: nn.Module | None = None if config.sees == "frames" else trunk(config)
        self.value = nn.Linear(config.hidden, 1)
        self.optimizer = Adam(self.parameters(), lr=schedule(1.0), eps=ADAM_EPSILON)

    def forward(self, inputs: Inputs, deterministic: bool = False) -> tuple[Tensor, Tensor, Tensor]:
        """Actions by chance or the best, the value, and the logarithm of the density."""
        nodes = self.actor.trunk(inputs)
        chances = self.actor.actions(nodes)
        actions = chances.best() if deterministic else chances.sample()
        return actions, self._value(inputs, nodes), chances.log_prob(actions)

    def evaluate_actions(self, inputs: Inputs, actions: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """The value, the logarithm of the density of these actions, and the entropy."""
        nodes = self.actor.trunk(inputs)
        chances = self.actor.actions(nodes)
        return self._value(inputs, nodes), chances.log_prob(actions), chances.entropy()

    def predict_values(self, inputs: Inputs) -> Tensor:
        """The value (N, 1)."""
        return self._value(inputs, self.actor.trunk(inputs) if self.below_value is None else None)

    def _predict(self, observation: Tensor | Inputs, deterministic: bool = False) -> Tensor:
        assert isinstance(observation, dict)
        return self.forward(observation, deterministic)[0]

    def _value(self, inputs: Inputs, nodes: Tensor | None) -> Tensor:
        below = nodes if self.below_value is None else self.below_value(inputs)
        value: Tensor = self.value(below)
        return value
