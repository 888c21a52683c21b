"""A network's file: tensors and all that belongs to them, as JSON in the header (safetensors).

Nothing is unpickled, so a file from a stranger can do no harm. Each of the systems has a kind of its own.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any, TypeVar

import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import load, save
from torch import Tensor, nn

from caldrive.files import as_type, read_json, write_whole

FORMAT_VERSION = 2
KEY = "caldrive"  # of the JSON in safetensors' metadata
UNFINISHED = "unfinished.safetensors"  # a network in the folder of a training that goes on
AGENTS = {"network": "cal", "cil": "cil", "mp": "mp", "rl": "rl"}  # by kind of tensors: who drives by them
FLOATS = ("F64", "F32", "F16", "BF16")  # safetensors' names
Info = TypeVar("Info")


class CheckpointError(ValueError):
    """A checkpoint cannot be used; the message says why."""


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


def read_known(path: Path, kind: str, info: type[Info]) -> Info:
    """What a header says of a network of some kind (a key of `AGENTS`), as a dataclass. Raises CheckpointError where
    the file is of another kind, or its header none of a training's."""
    header = read_header(path)
    require_kind(path, header, kind)
    return known(path, header, info)


def known(path: Path, header: Mapping[str, Any], info: type[Info]) -> Info:
    """The same from the header of a file of the right kind."""
    names = {part.name for part in fields(info)}  # type: ignore[arg-type]
    try:
        return as_type({name: header[name] for name in header.keys() & names}, info)
    except (KeyError, TypeError, ValueError) as error:
        raise CheckpointError(
            f"found in {path} a header that cannot be read ({error}), wanted a training's: train the network again"
        ) from error


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


def is_weight(value: Tensor) -> bool:
    """Not a bias, nor a statistic of a batch norm."""
    return value.is_floating_point() and value.dim() > 1


def round_to_half(network: nn.Module) -> None:
    """Rounds a network's weights in place to what 16 bits can hold, so that it is measured as it is stored."""
    for value in network.state_dict().values():
        if is_weight(value):
            value.copy_(value.half())


def in_single_precision(tensors: Mapping[str, Tensor]) -> dict[str, Tensor]:
    """16 bits as 32."""
    return {name: value.float() if value.dtype == torch.float16 else value for name, value in tensors.items()}
