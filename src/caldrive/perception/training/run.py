"""The steps of a training (section 3.1). What a step draws depends on (seed, step) only: a run killed anywhere resumes
to the same weights."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import torch
from torch import Generator, Tensor, nn
from torch.nn.parallel import DistributedDataParallel
from torch.optim import Adam

from caldrive.perception.dataset.augmentation import augment
from caldrive.perception.dataset.frames import Batch, Frames
from caldrive.perception.dataset.recolour import recolour
from caldrive.perception.dataset.sampler import Sampler
from caldrive.perception.images import normalise, to_float
from caldrive.perception.inference.engines import autocast
from caldrive.perception.network.config import NetworkConfig
from caldrive.perception.network.network import Network
from caldrive.perception.targets import ClassWeights, class_weights, multitask_loss
from caldrive.perception.training.config import TrainingConfig
from caldrive.perception.training.distributed import ProcessGroup
from caldrive.perception.training.initial import initial_network
from caldrive.perception.training.multitask import (
    SEGMENTATION,
    SEGMENTED_STAGE,
    MultiTaskModel,
    SegmentationHead,
    segmentation_loss,
)

SEED_STRIDE = 1_000_003  # more than the steps of a run, so that the steps of two runs have different seeds


def learning_rate(step: int, steps: int, config: TrainingConfig) -> float:
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
    """A training run: what changes from step to step, and what is needed to change it."""

    config: TrainingConfig
    model: MultiTaskModel
    optimizer: Adam
    sampler: Sampler
    class_weights: ClassWeights
    group: ProcessGroup
    step: int = 0
    _parallel: nn.Module = field(init=False)  # the model, or what averages its gradients over the processes

    def __post_init__(self) -> None:
        self._parallel = self.model
        if self.group.size > 1:  # a batch without some command leaves its group of nodes without a gradient
            self._parallel = DistributedDataParallel(self.model, find_unused_parameters=True)

    @property
    def network(self) -> Network:
        """The network that is trained."""
        return self.model.network

    @property
    def context(self) -> int:
        """Frames of history that a window brings along."""
        return 0 if self.history_steps else self.network.span - 1

    @property
    def history_steps(self) -> int:
        """Steps of the second stage; none where no block looks back."""
        return self.config.second_stage if self.network.span > 1 else 0

    @property
    def steps(self) -> int:
        """Steps of the first stage, of the whole network."""
        return self.config.steps - self.history_steps

    @property
    def rate(self) -> float:
        """The learning rate of the step that is next."""
        return learning_rate(self.step, self.steps, self.config)

    def advance(self) -> float:
        """One step; returns its loss, where there are several processes that of this one's share of the batch."""
        seed = (self.config.seed * SEED_STRIDE + self.step) * self.group.size + self.group.rank
        generator = Generator().manual_seed(seed)
        torch.manual_seed(seed)  # dropout
        loss = self._loss(self._batch(), generator)
        gradient_step(self.optimizer, loss, self.rate, self.config.clip)
        self.step += 1
        return float(loss.detach())

    def _batch(self) -> Batch:
        """This process' share of the step's windows."""
        config, share = self.config, slice(self.group.rank, None, self.group.size)
        starts = self.sampler.draw(self.step, config.batch)[share]
        alternatives = self.sampler.alternatives(self.step, config.batch, config.alternative_share)[share]
        return self.sampler.frames.batch(starts, config.window, self.context, alternatives)

    def _loss(self, batch: Batch, generator: Generator) -> Tensor:
        """The multi-task loss of a batch, and the segmentation's."""
        device, weights = self.group.device, vars(self.config.loss_weights)
        images = normalise(self._augmented(batch, generator))
        targets = {name: target.to(device) for name, target in batch.targets.items()}
        self._parallel.train()
        with autocast(self.config.precision, device):
            outputs = self._parallel(*(tensor.to(device) for tensor in (images, batch.index, batch.command)))
        loss = multitask_loss(outputs, targets, self.class_weights, weights)
        if batch.semantics is not None and SEGMENTATION in outputs:
            auxiliary = segmentation_loss(outputs[SEGMENTATION], batch.semantics, generator)
            loss = loss + weights[SEGMENTATION] * auxiliary
        return loss

    def _augmented(self, batch: Batch, generator: Generator) -> Tensor:
        """A batch's images (N, 3, H, W), recoloured where the recording has semantic images, and augmented."""
        images, config = to_float(batch.images), self.config
        if config.recolour.enabled and batch.semantics is not None:
            images = recolour(images, batch.semantics, batch.group, generator, config.recolour)
        if config.augmentation.enabled:
            images = augment(images, generator, batch.group, config.augmentation)
        return images


def start_run(
    config: TrainingConfig, network_config: NetworkConfig, frames: Frames, group: ProcessGroup
) -> TrainingRun:
    """A run at its first step, on these frames."""
    torch.manual_seed(config.seed)
    network = initial_network(config, network_config)
    head = None
    if config.loss_weights.segmentation and frames.has_semantics:
        head = SegmentationHead(network.backbone.channels[SEGMENTED_STAGE])
    model = MultiTaskModel(network, head, config.backbone_chunk).to(group.device)
    sampler = Sampler(frames, config.window, config.balance, config.seed)
    weights = {name: weight.to(group.device) for name, weight in class_weights(sampler.class_counts()).items()}
    return TrainingRun(config, model, Adam(model.parameters(), config.learning_rate), sampler, weights, group)
