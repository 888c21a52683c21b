"""How a training begins: with a new network, with ImageNet's weights in its backbone, or with what another learnt."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import torch
from torch.optim import Adam

from caldrive.perception.calibration import uncalibrated
from caldrive.perception.checkpoint import CheckpointError, load_network
from caldrive.perception.config import PerceptionConfig, TrainingConfig
from caldrive.perception.dataset import Frames
from caldrive.perception.lessons import Lessons
from caldrive.perception.network import Network
from caldrive.perception.optimisation import TrainingRun
from caldrive.perception.sampler import Sampler
from caldrive.perception.segmentation import STAGE, Segmentation
from caldrive.perception.specs import SPECS, class_weights
from caldrive.perception.team import Team


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
