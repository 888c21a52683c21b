"""A trained segmentation network on disk: a safetensors file, with all that belongs to it as JSON in its header."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from caldrive.agents.modular_pipeline.config import SegmentationConfig
from caldrive.agents.modular_pipeline.segmentation import SegmentationNetwork
from caldrive.perception.network.tensor_file import (
    in_single_precision,
    is_weight,
    load_state,
    read_known,
    read_tensors,
    require_shapes,
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


def save_segmentation(path: Path, network: SegmentationNetwork, info: SegmentationInfo) -> None:
    """Writes a network, whose weights take 16 bits each."""
    state = {name: value.half() if is_weight(value) else value for name, value in network.state_dict().items()}
    write_tensors(path, state, {"kind": KIND} | asdict(info))


def read_segmentation_info(path: Path) -> SegmentationInfo:
    """What is known of a network; its weights are not read. Raises CheckpointError where it is none of this kind."""
    return read_known(path, KIND, SegmentationInfo)


def load_segmentation(path: Path) -> tuple[SegmentationNetwork, SegmentationInfo]:
    """Reads a network, ready to see, and what is known of it. Raises CheckpointError where it does not fit this code,
    or cannot be what a training leaves."""
    info = read_segmentation_info(path)
    require_shapes(path, lambda: SegmentationNetwork(info.config))
    network = SegmentationNetwork(info.config)
    load_state(path, network, in_single_precision(read_tensors(path)[0]))
    return network, info
