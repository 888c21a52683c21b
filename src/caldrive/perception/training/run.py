"""The steps of a training (section 3.1). What a step draws depends on (seed, step) only: a run killed anywhere resumes
to the same weights."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from pathlib import Path

import torch
from torch import Tensor, nn
from torch.nn.parallel import DistributedDataParallel
from torch.optim import Adam

from caldrive.affordances import SPECS
from caldrive.perception.dataset.augmentation import augment
from caldrive.perception.dataset.frames import Batch, Frames
from caldrive.perception.dataset.recolour import repaint
from caldrive.perception.dataset.sampler import Sampler
from caldrive.perception.images import normalise, to_float
from caldrive.perception.inference.engines import autocast
from caldrive.perception.network.calibration import uncalibrated
from caldrive.perception.network.checkpoint import CheckpointError, load_network
from caldrive.perception.network.config import PerceptionConfig
from caldrive.perception.network.network import Network
from caldrive.perception.targets import ClassWeights, class_weights, loss
from caldrive.perception.training.config import TrainingConfig
from caldrive.perception.training.distributed import Team
from caldrive.perception.training.multitask import STAGE, Lessons, Segmentation, segmentation_loss


def learning_rate(step: int, config: TrainingConfig) -> float:
    """Rate of a step: a straight warm-up, then a cosine down to final_rate of the base rate."""
    if step < config.warm_up:
        return config.learning_rate * (step + 1) / config.warm_up
    done = (step - config.warm_up) / max(1, config.steps - config.warm_up)
    share = config.final_rate + (1 - config.final_rate) * (1 + math.cos(math.pi * done)) / 2
    return config.learning_rate * share


def descend(optimizer: Adam, total: Tensor, rate: float, clip: float) -> None:
    """One step of Adam's down the gradient of a loss, no longer than clip; then the gradient is gone."""
    (group,) = optimizer.param_groups
    group["lr"] = rate
    total.backward()  # type: ignore[no-untyped-call]
    torch.nn.utils.clip_grad_norm_(group["params"], clip)
    optimizer.step()
    optimizer.zero_grad(set_to_none=True)


@dataclass
class TrainingRun:
    """A training run: what changes from step to step, and what is needed to change it."""

    config: TrainingConfig
    lessons: Lessons
    optimizer: Adam
    sampler: Sampler
    weights: ClassWeights
    team: Team
    step: int = 0
    model: nn.Module = field(init=False)

    def __post_init__(self) -> None:
        self.model = self.lessons
        if self.team.size > 1:  # a batch without some command leaves its group of nodes without a gradient
            self.model = DistributedDataParallel(self.model, find_unused_parameters=True)

    @property
    def network(self) -> Network:
        return self.lessons.network

    @property
    def context(self) -> int:
        """Frames of history that a window brings along."""
        return 0 if self.config.block_steps else self.network.span - 1

    def advance(self) -> float:
        """One step; returns its loss, where there are several processes that of this one's share of the batch."""
        config, team = self.config, self.team
        seed = (config.seed * 1_000_003 + self.step) * team.size + team.rank
        generator = torch.Generator().manual_seed(seed)
        torch.manual_seed(seed)  # dropout
        mine = slice(team.rank, None, team.size)
        starts = self.sampler.draw(self.step, config.batch)[mine]
        others = self.sampler.others(self.step, config.batch, config.others)[mine]
        batch = self.sampler.frames.batch(starts, config.window, self.context, others)
        images = normalise(self._augmented(batch, generator))
        targets = {name: target.to(team.device) for name, target in batch.targets.items()}
        self.model.train()
        with autocast(config.precision, team.device):
            outputs = self.model(*(x.to(team.device) for x in (images, batch.index, batch.command)))
        total = loss(outputs, targets, self.weights, config.angle_weight)
        if batch.semantics is not None and "segmentation" in outputs:
            second = segmentation_loss(outputs["segmentation"], batch.semantics, generator)
            total = total + config.segmentation * second
        descend(self.optimizer, total, learning_rate(self.step, config), config.clip)
        self.step += 1
        return float(total.detach())

    def _augmented(self, batch: Batch, generator: torch.Generator) -> Tensor:
        """A batch's images (N, 3, H, W), augmented where that is wanted, and painted anew where it is known how."""
        images = to_float(batch.images)
        if not self.config.augment:
            return images
        if self.config.repaint and batch.semantics is not None:
            images = repaint(images, batch.semantics, batch.group, generator)
        return augment(images, generator, batch.group)


def anew(found: PerceptionConfig, wanted: PerceptionConfig) -> list[str]:
    """Names of the task blocks that cannot be taken from a network, as they are built otherwise than wanted."""
    pairs = ((spec.name, getattr(found, spec.name), getattr(wanted, spec.name)) for spec in SPECS)
    return [name for name, old, new in pairs if replace(old, dropout=new.dropout) != new]


def _initial(path: str, perception: PerceptionConfig) -> Network:
    """A network that begins with a trained one's backbone, and with those of its blocks that are built as wanted.

    Raises CheckpointError where the backbone is not.
    """
    found, info = load_network(path)
    wanted = {spec.name: getattr(perception, spec.name) for spec in SPECS}
    if replace(info.config, **wanted) != perception:
        raise CheckpointError(f"{path} is a network of another width or image size than wanted: give its --preset")
    network, found = Network(perception), uncalibrated(found, info.data.get("train_classes", {}))
    network.backbone.load_state_dict(found.backbone.state_dict())
    for name in wanted.keys() - set(anew(info.config, perception)):
        network.blocks[name].load_state_dict(found.blocks[name].state_dict())
    return network


def start(
    config: TrainingConfig,
    perception: PerceptionConfig,
    frames: Frames,
    imagenet: Path | None,
    team: Team,
    initial: str | None = None,
) -> TrainingRun:
    """A run at its first step; initial: the network to begin with."""
    torch.manual_seed(config.seed)
    network = Network(perception) if initial is None else _initial(initial, perception)
    if imagenet is not None:
        network.backbone.load_imagenet(imagenet)
    head = None
    if config.segmentation and frames.has_semantics:
        head = Segmentation(network.backbone.channels[STAGE])
    lessons = Lessons(network, head, config.at_once).to(team.device)
    sampler = Sampler(frames, config.window, config.balance, config.seed)
    weights = {name: weight.to(team.device) for name, weight in class_weights(sampler.class_counts()).items()}
    return TrainingRun(config, lessons, Adam(lessons.parameters(), config.learning_rate), sampler, weights, team)
