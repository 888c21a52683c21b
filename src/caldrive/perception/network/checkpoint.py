"""A trained network on disk: one safetensors file, with all that belongs to it as JSON in its header.

Nothing is unpickled, so a file from a stranger can do no harm.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path
from typing import Any, TypedDict, TypeVar

import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import load, save
from torch import Tensor, nn

from caldrive.affordances import DISCRETE, describe
from caldrive.files import as_type, read_json, write_whole
from caldrive.perception.network.config import NetworkConfig
from caldrive.perception.network.network import Network

FORMAT_VERSION = 2
KEY = "caldrive"  # of the JSON in safetensors' metadata
CAMERA_CHECK = "camera_check."  # what the names of the camera check's tensors begin with
UNFINISHED = "unfinished.safetensors"  # a network in the folder of a training that goes on
AGENTS = {"network": "cal", "cil": "cil", "mp": "mp", "rl": "rl"}  # by kind of tensors: who drives by them
Info = TypeVar("Info")
FLOATS = ("F64", "F32", "F16", "BF16")  # safetensors' names
SMALLEST_SPREAD = 1e-12  # of the values of a matrix of weights; the smallest that 16 bits tell apart is 6e-8


class DataSummary(TypedDict, total=False):
    """What a checkpoint says of its data. train_classes: frames of each class by discrete affordance;
    validation_episodes: keys of those kept for validation."""

    train_frames: int
    validation_frames: int
    train_classes: dict[str, list[int]]
    validation_episodes: list[str]


class CheckpointError(ValueError):
    """A checkpoint cannot be used; the message says why."""


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


def write_tensors(path: Path, tensors: dict[str, Tensor], header: dict[str, Any]) -> None:
    """Write tensors and a JSON header, whole or not at all."""
    contiguous = {name: tensor.detach().cpu().contiguous() for name, tensor in tensors.items()}
    text = json.dumps({"version": FORMAT_VERSION} | header, allow_nan=False)
    write_whole(path, save(contiguous, metadata={KEY: text}))


def read_header(path: Path) -> dict[str, Any]:
    """Header of a file by `write_tensors`; of its tensors only the names are read.

    Raises CheckpointError where it is missing, damaged or foreign.
    """
    if not path.is_file():
        raise CheckpointError(_missing(path))
    try:
        with safe_open(path, "pt") as file:
            metadata = file.metadata() or {}
        header = read_json(metadata[KEY], dict[str, Any]) if KEY in metadata else None
    except (SafetensorError, OSError, ValueError) as error:
        raise CheckpointError(
            f"found that {path} is damaged or no safetensors file, wanted a whole one: copy it again, or train again"
        ) from error
    if header is None:
        raise CheckpointError(
            f"found tensors in {path}, but no network of caldrive, wanted one: give a file made by caldrive train"
        )
    if header.get("version") != FORMAT_VERSION:
        raise CheckpointError(
            f"found format {header.get('version')} in {path}, wanted {FORMAT_VERSION}: train the network again"
        )
    return header


def require_kind(path: Path, header: Mapping[str, Any], wanted: str) -> None:
    """Raises CheckpointError where a file's tensors are not of this kind (a key of `AGENTS`), but another agent's, or
    part of a training."""
    found = header.get("kind")
    if found == wanted:
        return
    if found in AGENTS:
        raise CheckpointError(
            f"found in {path} weights of the agent {AGENTS[found]}, wanted those of {AGENTS[wanted]}: type "
            f"--agent {AGENTS[found]}, or give another file"
        )
    raise CheckpointError(f"found part of a training in {path}, wanted a finished network: give its model.safetensors")


def _missing(path: Path) -> str:
    """A sentence on a file that is not there."""
    unfinished = path.with_name(UNFINISHED)
    if path != unfinished and unfinished.is_file():
        return (
            f"found a training in {path.parent} that is not finished, wanted its network {path.name}: type caldrive "
            f"train as before, or give {unfinished} as it is"
        )
    return f"found no file {path}, wanted a network: check the name, or type caldrive train"


def read_tensors(path: Path) -> tuple[dict[str, Tensor], dict[str, Any]]:
    """Tensors and header of a file by `write_tensors`. Raises CheckpointError as `read_header`."""
    header = read_header(path)
    return load(path.read_bytes()), header


def is_weight(value: Tensor) -> bool:
    """Not a bias, nor a statistic of a batch norm."""
    return value.is_floating_point() and value.dim() > 1


def round_to_half(network: nn.Module) -> None:
    """Rounds a network's weights in place to what 16 bits can hold, so that it is measured as it is stored."""
    for value in network.state_dict().values():
        if is_weight(value):
            value.copy_(value.half())


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
    return read_known(path, "network", CheckpointInfo)


def read_known(path: Path, kind: str, info: type[Info]) -> Info:
    """What a header says of a network of some kind (a key of `AGENTS`), as a dataclass. Raises CheckpointError where
    the file is of another kind, or its header none of a training's."""
    header = read_header(path)
    require_kind(path, header, kind)
    names = {part.name for part in fields(info)}  # type: ignore[arg-type]
    try:
        return as_type({name: header[name] for name in header.keys() & names}, info)
    except (KeyError, TypeError, ValueError) as error:
        raise CheckpointError(
            f"found in {path} a header that cannot be read ({error}), wanted a training's: train the network again"
        ) from error


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
    return {
        name.removeprefix(prefix): value.float() if value.dtype == torch.float16 else value
        for name, value in tensors.items()
        if name.startswith(CAMERA_CHECK) == camera_check
    }


def require_shapes(
    path: Path,
    build: Callable[[], nn.Module],
    is_extra: Callable[[str], bool] = lambda name: False,
    *,
    in_bytes: bool = False,
) -> None:
    """Raises CheckpointError where a file's tensors have not the names, shapes and kinds of what its settings build.
    Nothing is allocated: settings may ask for more memory than there is.

    is_extra: whether a tensor of this name is not the network's own. in_bytes: whether weights are whole numbers.
    """
    with torch.device("meta"):
        state = build().state_dict()
    with safe_open(path, "pt") as file:
        names = [name for name in file.keys() if not is_extra(name)]  # noqa: SIM118 (no dictionary)
        slices = {name: file.get_slice(name) for name in names}
        found = {name: (part.get_shape(), part.get_dtype() in FLOATS) for name, part in slices.items()}
    wanted = {
        name: (list(value.shape), value.is_floating_point() and not (in_bytes and is_weight(value)))
        for name, value in state.items()
    }
    if found != wanted:
        raise CheckpointError(
            f"found in {path} weights that do not fit its own settings, wanted those that do: train the network again"
        )


def load_state(path: Path, network: nn.Module, state: dict[str, Tensor]) -> None:
    """Gives a network its weights, ready for evaluation. Raises CheckpointError where they are not numbers."""
    if not all(bool(value.isfinite().all()) for value in state.values()):
        raise CheckpointError(f"found in {path} weights that are not numbers, wanted a trained network: train it again")
    network.load_state_dict(state)
    network.eval()


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
