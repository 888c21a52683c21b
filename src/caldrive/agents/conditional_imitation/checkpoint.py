"""A trained imitation network on disk: a safetensors file whose weights take a byte each, with all that belongs to it
as JSON in its header."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from caldrive.agents.conditional_imitation.config import ImitationNetworkConfig
from caldrive.agents.conditional_imitation.network import ImitationNetwork
from caldrive.perception.network.tensor_file import (
    is_weight,
    load_state,
    read_known,
    read_tensors,
    require_shapes,
    write_tensors,
)

KIND = "cil"
SCALE = ".scale"  # follows a weight's name: for each output of its layer, what a byte counts
MOST_BYTE = 127


@dataclass(frozen=True)
class ImitationInfo:
    """What is known of a trained network: its settings, its data, the figures of its validation, and the range of what
    enters each of its convolutions (empty where nobody looked)."""

    config: ImitationNetworkConfig
    data: dict[str, Any] = field(default_factory=dict)
    metrics: dict[str, float] = field(default_factory=dict)
    training: dict[str, Any] = field(default_factory=dict)
    ranges: tuple[float, ...] = ()


def _rows(values: Tensor) -> tuple[Tensor, Tensor]:
    """A weight as bytes, and for each output of its layer what a byte counts."""
    flat = values.detach().float().flatten(1)
    scale = (flat.abs().amax(dim=1) / MOST_BYTE).clamp(min=1e-12)
    return (flat / scale[:, None]).round().to(torch.int8).reshape(values.shape), scale


def _from_rows(values: Tensor, scale: Tensor) -> Tensor:
    return values.float() * scale.reshape(-1, *[1] * (values.dim() - 1))


def round_to_bytes(network: ImitationNetwork) -> None:
    """Rounds a network's weights in place to what its file holds, so that it is measured as it is stored."""
    for value in network.state_dict().values():
        if is_weight(value):
            value.copy_(_from_rows(*_rows(value)))


def save_imitation(path: Path, network: ImitationNetwork, info: ImitationInfo) -> None:
    """Writes a network, whose weights take a byte each: seven million of two bytes would be larger than what ships."""
    tensors = dict[str, Tensor]()
    for name, value in network.state_dict().items():
        if is_weight(value):
            tensors[name], tensors[name + SCALE] = _rows(value)
        else:
            tensors[name] = value
    write_tensors(path, tensors, {"kind": KIND} | asdict(info))


def read_imitation_info(path: Path) -> ImitationInfo:
    """What is known of a network; its weights are not read. Raises CheckpointError where it is none of this kind."""
    return read_known(path, KIND, ImitationInfo)


def load_imitation(path: Path) -> tuple[ImitationNetwork, ImitationInfo]:
    """Reads a network, ready to drive, and what is known of it. Raises CheckpointError where it does not fit this code,
    or cannot be what a training leaves."""
    info = read_imitation_info(path)
    require_shapes(path, lambda: ImitationNetwork(info.config), lambda name: name.endswith(SCALE), in_bytes=True)
    tensors, _ = read_tensors(path)
    scales = {name: tensors.pop(name) for name in list(tensors) if name.endswith(SCALE)}
    state = {
        name: _from_rows(value, scales[name + SCALE]) if name + SCALE in scales else value
        for name, value in tensors.items()
    }
    network = ImitationNetwork(info.config)
    load_state(path, network, state)
    return network, info
