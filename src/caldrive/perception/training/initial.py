"""What a training begins with: a new network, a new one on ImageNet's weights, or a trained one."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import torch

from caldrive.affordances import SPECS
from caldrive.perception.network.calibration import uncalibrated
from caldrive.perception.network.checkpoint import load_network, read_info
from caldrive.perception.network.config import NetworkConfig
from caldrive.perception.network.network import Network
from caldrive.perception.network.tensor_file import CheckpointError
from caldrive.perception.training.config import TrainingConfig


def without_initial_weights(config: TrainingConfig) -> TrainingConfig:
    """The settings for a run that is resumed: the files with which it began are needed no more."""
    return replace(config, initial=None, imagenet="none")


def with_initial_weights(config: TrainingConfig) -> TrainingConfig:
    """The settings for a run that begins, with ImageNet's weights as a file. Raises ValueError where there is none."""
    if config.initial:
        return replace(config, imagenet="none")
    return replace(config, imagenet=str(_cached_imagenet())) if config.imagenet == "cache" else config


def _cached_imagenet() -> Path:
    """VGG16's weights in torch.hub's cache."""
    folder = Path(torch.hub.get_dir()) / "checkpoints"
    files = sorted(folder.glob("vgg16-*.pth"))
    if not files:
        raise ValueError(
            f"found no vgg16-*.pth in {folder}, wanted VGG16's state dict: put it there, or type --imagenet FILE"
        )
    return files[0]


def initial_network(config: TrainingConfig, network_config: NetworkConfig) -> Network:
    """The network at a training's first step. Raises ValueError where weights do not fit it."""
    if config.initial:
        return _from_trained(config.initial, network_config)
    network = Network(network_config)
    if config.imagenet != "none":
        network.backbone.load_imagenet(config.imagenet)
    return network


def _from_trained(path: str, wanted: NetworkConfig) -> Network:
    """A network with a trained one's backbone, and with those of its blocks that are built as wanted.

    Raises CheckpointError where the backbone is built differently.
    """
    trained, info = load_network(path)
    blocks = {spec.name: getattr(wanted, spec.name) for spec in SPECS}
    if replace(info.config, **blocks) != wanted:
        raise CheckpointError(
            f"found in {path} a network of another width or image size, wanted one like that which is trained: "
            "type its --preset"
        )
    network, trained = Network(wanted), uncalibrated(trained, info.data.get("train_classes", {}))
    network.backbone.load_state_dict(trained.backbone.state_dict())
    for name in blocks.keys() - set(different_blocks(info.config, wanted)):
        network.blocks[name].load_state_dict(trained.blocks[name].state_dict())
    return network


def different_blocks(trained: NetworkConfig, wanted: NetworkConfig) -> list[str]:
    """Names of the task blocks that cannot be taken from a trained network, as they are not built as wanted."""
    pairs = ((spec.name, getattr(trained, spec.name), getattr(wanted, spec.name)) for spec in SPECS)
    return [name for name, old, new in pairs if replace(old, dropout=new.dropout) != new]


def untrained_blocks(config: TrainingConfig, network_config: NetworkConfig) -> list[str]:
    """The task blocks that `initial` does not give to a run that begins; none without it."""
    return different_blocks(read_info(config.initial).config, network_config) if config.initial else []
