"""A trained segmentation network on disk: a safetensors file, with all that belongs to it as JSON in its header."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import torch
from safetensors import safe_open

from caldrive.agents.modular_pipeline.config import SegmentationConfig
from caldrive.agents.modular_pipeline.segmentation import SegmentationNetwork
from caldrive.files import as_type
from caldrive.perception.network.checkpoint import (
    CheckpointError,
    is_weight,
    read_header,
    read_tensors,
    require_kind,
    write_tensors,
)

KIND = "mp"


@dataclass(frozen=True)
class SegmentationInfo:
    """What is known of a trained network: its settings, its data, the figures of its validation, the settings of its
    training, and the range of what enters each convolution of its backbone (empty where nobody looked)."""

    config: SegmentationConfig
    data: dict[str, Any] = field(default_factory=dict)
    metrics: dict[str, float] = field(default_factory=dict)
    training: dict[str, Any] = field(default_factory=dict)
    ranges: tuple[float, ...] = ()


def round_weights(network: SegmentationNetwork) -> None:
    """Rounds a network's weights in place to what its file holds, so that it is measured as it is stored."""
    for value in network.state_dict().values():
        if is_weight(value):
            value.copy_(value.half())


def save_segmentation(path: Path, network: SegmentationNetwork, info: SegmentationInfo) -> None:
    """Writes a network, whose weights take 16 bits each."""
    state = {name: value.half() if is_weight(value) else value for name, value in network.state_dict().items()}
    write_tensors(path, state, {"kind": KIND} | asdict(info))


def read_segmentation_info(path: Path) -> SegmentationInfo:
    """What is known of a network; its weights are not read. Raises CheckpointError where it is none of this kind."""
    header = read_header(path)
    require_kind(path, header, KIND)
    try:
        return as_type({name: header[name] for name in SegmentationInfo.__dataclass_fields__}, SegmentationInfo)
    except (KeyError, TypeError, ValueError) as error:
        raise CheckpointError(
            f"found in {path} a header that cannot be read ({error}), wanted a training's: train the network again"
        ) from error


def load_segmentation(path: Path) -> tuple[SegmentationNetwork, SegmentationInfo]:
    """Reads a network, ready to see, and what is known of it. Raises CheckpointError where it does not fit this code,
    or cannot be what a training leaves."""
    info = read_segmentation_info(path)
    with torch.device("meta"):  # settings may ask for more memory than there is
        wanted = {name: list(value.shape) for name, value in SegmentationNetwork(info.config).state_dict().items()}
    with safe_open(path, "pt") as file:
        found = {name: file.get_slice(name).get_shape() for name in file.keys()}  # noqa: SIM118 (no dictionary)
    if found != wanted:
        raise CheckpointError(
            f"found in {path} weights that do not fit its own settings, wanted those that do: train the network again"
        )
    tensors, _ = read_tensors(path)
    state = {name: value.float() if value.is_floating_point() else value for name, value in tensors.items()}
    if not all(bool(value.isfinite().all()) for value in state.values()):
        raise CheckpointError(f"found in {path} weights that are not numbers, wanted a trained network: train it again")
    network = SegmentationNetwork(info.config)
    network.load_state_dict(state)
    return network.eval(), info
