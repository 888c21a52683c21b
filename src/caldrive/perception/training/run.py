"""The steps of a training, whatever it trains. What a step draws depends on (seed, step) only: a run killed anywhere
resumes to the same weights."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

import torch
from torch import Generator, Tensor, nn
from torch.nn.parallel import DistributedDataParallel
from torch.optim import Adam

from caldrive.perception.training.config import LoopConfig
from caldrive.perception.training.distributed import ProcessGroup
from caldrive.perception.training.folder import TrainingFolder
from caldrive.progress import Progress

SEED_STRIDE = 1_000_003  # more than the steps of a run, so that the steps of two runs have different seeds


class Learner(Protocol):
    """What a training trains, on which frames and by which loss: CAL's network, and those of the systems that it is
    compared with."""

    config: Any
    """Its settings: a `LoopConfig`, and what it has beside that."""

    @property
    def model(self) -> nn.Module:
        """What learns."""
        ...

    @property
    def figures(self) -> Sequence[str]:
        """Names of the validation's figures, for the curves."""
        ...

    @property
    def steps(self) -> int:
        """Steps of the whole model; `finish` comes after them."""
        ...

    @property
    def network_settings(self) -> Mapping[str, Any]:
        """What the model is built from, by name: weights fit one that is built alike."""
        ...

    @property
    def data_digest(self) -> str:
        """Tells what it learns from from everything else."""
        ...

    def loss(self, step: int, share: slice, forward: nn.Module, generator: Generator) -> Tensor:
        """The loss of a step's batch, of which this process has a share. forward: the model, or what averages its
        gradients over the processes."""
        ...

    def validate(self, path: Path) -> dict[str, float]:
        """Writes the network as it is, and returns the figures of its validation."""
        ...

    def finish(self, folder: TrainingFolder, progress: Progress) -> None:
        """Makes a finished network, `folder.model`, of a whole one, unless it is there already. A network that somebody
        removed comes again."""
        ...


def learning_rate(step: int, steps: int, config: LoopConfig) -> float:
    """Rate of one of a stage's steps: a straight warm-up, then a cosine down to final_rate of the base rate."""
    if step < config.warm_up:
        return config.learning_rate * (step + 1) / config.warm_up
    done = (step - config.warm_up) / max(1, steps - config.warm_up)
    share = config.final_rate + (1 - config.final_rate) * (1 + math.cos(math.pi * done)) / 2
    return config.learning_rate * share


def gradient_step(optimizer: Adam, loss: Tensor, rate: float, clip: float) -> None:
    """One step of Adam's down the gradient of a loss, whose norm is clipped; then the gradient is gone."""
    (group,) = optimizer.param_groups
    group["lr"] = rate
    loss.backward()  # type: ignore[no-untyped-call]
    torch.nn.utils.clip_grad_norm_(group["params"], clip)
    optimizer.step()
    optimizer.zero_grad(set_to_none=True)


@dataclass
class TrainingRun:
    """A training under way: what learns, and how far it has come."""

    learner: Learner
    group: ProcessGroup
    step: int = 0
    optimizer: Adam = field(init=False)
    _forward: nn.Module = field(init=False)  # the model, or what averages its gradients over the processes

    def __post_init__(self) -> None:
        config, self._forward = self.config, self.learner.model
        self.optimizer = Adam(self._forward.parameters(), config.learning_rate, config.betas)
        if self.group.size > 1:  # a batch without some command leaves its group of nodes without a gradient
            self._forward = DistributedDataParallel(self.learner.model, find_unused_parameters=True)

    @property
    def config(self) -> LoopConfig:
        """The learner's settings."""
        config: LoopConfig = self.learner.config
        return config

    @property
    def rate(self) -> float:
        """The learning rate of the step that is next."""
        return learning_rate(self.step, self.learner.steps, self.config)

    def advance(self) -> float:
        """One step; returns its loss, where there are several processes that of this one's share of the batch."""
        seed = (self.config.seed * SEED_STRIDE + self.step) * self.group.size + self.group.rank
        torch.manual_seed(seed)  # dropout
        self._forward.train()
        share = slice(self.group.rank, None, self.group.size)
        loss = self.learner.loss(self.step, share, self._forward, Generator().manual_seed(seed))
        gradient_step(self.optimizer, loss, self.rate, self.config.clip)
        self.step += 1
        return float(loss.detach())
