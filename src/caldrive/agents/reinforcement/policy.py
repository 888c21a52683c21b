"""The policy: what it is given to a distribution over actions, of which it takes the mean at the wheel."""

from __future__ import annotations

from typing import Any, Protocol

import torch
from torch import Tensor, nn
from torch.distributions import Beta, Categorical
from torch.nn.functional import softplus

from caldrive.agents.reinforcement.config import FRAME, N_FRAMES, PolicyConfig

SLOPE = 0.1  # of the leaky ReLUs below 0
EDGE = 1e-6  # from the ends of a Beta distribution, where its density may be infinite
FEW = 0.01  # what the last layer's first weights are multiplied by: at first a policy acts alike whatever it sees
# Alphas and betas of throttle and steering at first, before the softplus: rather gas than brake, and no wild steering.
# A car that does not move, or leaves its lane at once, finds out nothing.
FIRST = (2.0, 3.0, 0.5, 3.0)


class Actions(Protocol):
    """A distribution over actions, one for each of N."""

    def sample(self) -> Tensor:
        """An action by chance."""
        ...

    def best(self) -> Tensor:
        """The action that is taken at the wheel."""
        ...

    def log_prob(self, actions: Tensor) -> Tensor:
        """Logarithm of the density (N,)."""
        ...

    def entropy(self) -> Tensor:
        """(N,)."""
        ...


class Choices:
    """The nine actions of the paper's RL, each with its probability. outputs: (N, 9)."""

    def __init__(self, outputs: Tensor) -> None:
        self._chances: Any = Categorical(logits=outputs, validate_args=False)

    def sample(self) -> Tensor:
        """(N,)."""
        actions: Tensor = self._chances.sample()
        return actions

    def best(self) -> Tensor:
        """The likeliest (N,)."""
        best: Tensor = self._chances.logits.argmax(1)
        return best

    def log_prob(self, actions: Tensor) -> Tensor:
        """Of actions (N,) or (N, 1)."""
        logarithm: Tensor = self._chances.log_prob(actions.reshape(-1))
        return logarithm

    def entropy(self) -> Tensor:
        """(N,)."""
        entropy: Tensor = self._chances.entropy()
        return entropy


class Betas:
    """Numbers in [-1, 1], each by a Beta distribution with one peak (Petrazzini and Antonelo 2021, and Roach): unlike a
    Gaussian it ends where the actions do. outputs: (N, 4), alphas and then betas before a softplus, from 1 on."""

    def __init__(self, outputs: Tensor) -> None:
        alpha, beta = (1 + softplus(outputs)).chunk(2, dim=1)
        self._shares: Any = Beta(alpha, beta, validate_args=False)

    def sample(self) -> Tensor:
        """(N, 2)."""
        actions: Tensor = 2 * self._shares.sample() - 1
        return actions

    def best(self) -> Tensor:
        """The means (N, 2)."""
        means: Tensor = 2 * self._shares.mean - 1
        return means

    def log_prob(self, actions: Tensor) -> Tensor:
        """Of actions (N, 2), but for a constant."""
        shares = ((actions + 1) / 2).clamp(EDGE, 1 - EDGE)
        logarithm: Tensor = self._shares.log_prob(shares).sum(1)
        return logarithm

    def entropy(self) -> Tensor:
        """(N,), but for the same constant."""
        entropy: Tensor = self._shares.entropy().sum(1)
        return entropy


class Convolutions(nn.Module):
    """Two frames and some numbers to `hidden` nodes, as the paper's RL has them: three convolutions and a layer for the
    frames, two layers for the numbers, one for both (S.2.3)."""

    def __init__(self, n_numbers: int, hidden: int) -> None:
        super().__init__()
        self.frames = nn.Sequential(
            nn.Conv2d(N_FRAMES, 32, 8, 4), nn.LeakyReLU(SLOPE),
            nn.Conv2d(32, 64, 4, 2), nn.LeakyReLU(SLOPE),
            nn.Conv2d(64, 64, 3, 1), nn.LeakyReLU(SLOPE), nn.Flatten(),
        )  # fmt: skip
        with torch.no_grad():
            n_features = int(self.frames(torch.zeros(1, N_FRAMES, FRAME, FRAME)).shape[1])
        self.frames.extend(_layer(n_features, hidden))
        self.numbers = nn.Sequential(*_layer(n_numbers, hidden), *_layer(hidden, hidden))
        self.both = _layer(2 * hidden, hidden)

    def forward(self, inputs: dict[str, Tensor]) -> Tensor:
        """frames (N, 2, 84, 84) in bytes and numbers (N, F) to (N, hidden)."""
        frames = self.frames(inputs["frames"].float() / 255 - 0.5)
        both: Tensor = self.both(torch.cat((frames, self.numbers(inputs["numbers"])), dim=1))
        return both


class Layers(nn.Module):
    """Numbers to `hidden` nodes through two layers."""

    def __init__(self, n_numbers: int, hidden: int) -> None:
        super().__init__()
        self.layers = nn.Sequential(*_layer(n_numbers, hidden), *_layer(hidden, hidden))

    def forward(self, inputs: dict[str, Tensor]) -> Tensor:
        """numbers (N, F) to (N, hidden)."""
        nodes: Tensor = self.layers(inputs["numbers"])
        return nodes


class Joined(nn.Module):
    """An encoder's features and a few numbers to `hidden` nodes: a layer for the features, two for the numbers, one for
    both. Side by side in one layer the command would be lost among hundreds of features."""

    def __init__(self, n_features: int, n_own: int, hidden: int) -> None:
        super().__init__()
        self.sizes = [n_features, n_own]
        self.features = _layer(n_features, hidden)
        self.own = nn.Sequential(*_layer(n_own, hidden), *_layer(hidden, hidden))
        self.both = _layer(2 * hidden, hidden)

    def forward(self, inputs: dict[str, Tensor]) -> Tensor:
        """numbers (N, F), the features first, to (N, hidden)."""
        features, own = torch.split(inputs["numbers"], self.sizes, dim=1)
        both: Tensor = self.both(torch.cat((self.features(features), self.own(own)), dim=1))
        return both


def trunk(config: PolicyConfig) -> nn.Module:
    """What is below the outputs of a policy, or of the value that its training estimates."""
    if config.sees == "features":
        return Joined(config.n_features, config.n_own, config.hidden)
    kind = Convolutions if config.sees == "frames" else Layers
    return kind(config.n_numbers, config.hidden)


def _layer(n_in: int, n_out: int) -> nn.Sequential:
    return nn.Sequential(nn.Linear(n_in, n_out), nn.LeakyReLU(SLOPE))


class Policy(nn.Module):
    """A policy: a trunk, and the parameters of a distribution over actions."""

    def __init__(self, config: PolicyConfig) -> None:
        super().__init__()
        self.config = config
        self.trunk = trunk(config)
        self.outputs = nn.Linear(config.hidden, config.n_outputs)
        with torch.no_grad():
            self.outputs.weight.mul_(FEW)
            first = torch.tensor(FIRST if config.action == "continuous" else (0.0,) * config.n_outputs)
            self.outputs.bias.copy_(first)

    def actions(self, nodes: Tensor) -> Actions:
        """What the trunk makes of its inputs, (N, hidden), to a distribution."""
        kind = Choices if self.config.action == "carla2017" else Betas
        return kind(self.outputs(nodes))

    def forward(self, inputs: dict[str, Tensor]) -> Actions:
        """Inputs, of N decisions, to their distributions."""
        return self.actions(self.trunk(inputs))
