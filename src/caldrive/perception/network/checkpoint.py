"""CAL's trained network on disk: one file by `tensor_file`, with the camera check's tensors beside its own."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, TypedDict

from safetensors.torch import load
from torch import Tensor

from caldrive.affordances import DISCRETE, describe
from caldrive.perception.network.config import NetworkConfig
from caldrive.perception.network.network import Network
from caldrive.perception.network.tensor_file import (
    CheckpointError,
    in_single_precision,
    is_weight,
    known,
    load_state,
    read_header,
    require_kind,
    require_shapes,
    write_tensors,
)

CAMERA_CHECK = "camera_check."  # what the names of the camera check's tensors begin with
SMALLEST_SPREAD = 1e-12  # of the values of a matrix of weights; the smallest that 16 bits tell apart is 6e-8


class DataSummary(TypedDict, total=False):
    """What a checkpoint says of its data. train_classes: frames of each class by discrete affordance;
    validation_episodes: keys of those kept for validation."""

    train_frames: int
    validation_frames: int
    train_classes: dict[str, list[int]]
    validation_episodes: list[str]


@dataclass(frozen=True)
class CheckpointInfo:
    """What is known of a trained network: its configuration, its data, its validation metrics, the settings of its
    training, and the range of what enters each of its convolutions (empty where nobody looked).

    The metrics are those in the precision of the training, not in the 8 bits in which it may drive.
    """

    config: NetworkConfig
    data: DataSummary = field(default_factory=DataSummary)
    metrics: dict[str, float] = field(default_factory=dict)
    training: dict[str, Any] = field(default_factory=dict)
    seed: int = 0
    ranges: tuple[float, ...] = ()


def save_network(path: Path | str, network: Network, info: CheckpointInfo, half: bool = False) -> None:
    """Write a network; `half` stores weights, though not batch norm's statistics, in 16 bits."""
    state = network.state_dict()
    if half:
        state = {k: v.half() if is_weight(v) else v for k, v in state.items()}
    write_tensors(Path(path), state, {"kind": "network", "specs": describe()} | asdict(info))


def read_info(path: Path | str) -> CheckpointInfo:
    """What is known of a network; its weights are not read. Raises CheckpointError where it is none of this code's
    kind."""
    path = Path(path)
    header = read_header(path)
    require_kind(path, header, "network")
    if header.get("specs") != describe():
        raise CheckpointError(
            f"found in {path} a network for other affordances, wanted those of this caldrive: train the network again"
        )
    return known(path, header, CheckpointInfo)


def load_network(path: Path | str) -> tuple[Network, CheckpointInfo]:
    """Read a network, ready for evaluation, and what is known of it. Raises CheckpointError where it does not fit this
    code, or cannot be what a training leaves."""
    path = Path(path)
    info = read_info(path)
    require_shapes(path, lambda: Network(info.config), is_extra=lambda name: name.startswith(CAMERA_CHECK))
    network = Network(info.config)
    load_state(path, network, single_precision(load(path.read_bytes()), camera_check=False))
    if fault := _fault(network, info):
        raise CheckpointError(f"found in {path} {fault}, wanted a trained network: train it again")
    return network, info


def single_precision(tensors: dict[str, Tensor], *, camera_check: bool) -> dict[str, Tensor]:
    """Of a network's file the camera check's tensors, by their own names, or all others; 16 bits as 32."""
    prefix = CAMERA_CHECK if camera_check else ""
    chosen = {name: value for name, value in tensors.items() if name.startswith(CAMERA_CHECK) == camera_check}
    return {name.removeprefix(prefix): value for name, value in in_single_precision(chosen).items()}


def _fault(network: Network, info: CheckpointInfo) -> str:
    """What is not as a training leaves it, or nothing."""
    state = network.state_dict()
    if any(bool((value < 0).any()) for name, value in state.items() if name.endswith("running_var")):
        return "variances less than 0"
    if alike := [name for name, value in state.items() if ".weight" in name and _is_constant(value)]:
        return f"weights {alike[0]} that are all alike"
    if not all(0 < size < math.inf for size in info.ranges):
        return "ranges of integers that are not more than 0"
    if info.ranges and len(info.ranges) != len(network.backbone.convolutions()):
        return f"{len(info.ranges)} ranges of integers for {len(network.backbone.convolutions())} convolutions"
    outputs = {spec.name: spec.outputs for spec in DISCRETE}
    counts = info.data.get("train_classes", {})
    if any(len(count) != outputs.get(name) or min(count) < 0 or not sum(count) for name, count in counts.items()):
        return "counts of other classes than this caldrive's"
    return ""


def _is_constant(weight: Tensor) -> bool:
    """Whether nothing depends on a weight's input: all of it is 0, or a matrix has one value throughout."""
    if weight.dim() == 1 or weight.numel() == 1:
        return not bool(weight.any())
    return bool(weight.max() - weight.min() < SMALLEST_SPREAD)
