"""A policy on disk: one safetensors file with what the wheel needs, the frozen encoder included."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field, fields
from pathlib import Path
from typing import Any

import torch
from torch import Tensor, nn

from caldrive.agents.reinforcement.config import PolicyConfig
from caldrive.agents.reinforcement.encoder import Encoder
from caldrive.agents.reinforcement.policy import Policy
from caldrive.files import as_type
from caldrive.perception.network.backbone import Backbone
from caldrive.perception.network.checkpoint import (
    CheckpointError,
    is_weight,
    read_header,
    read_tensors,
    require_kind,
    single_precision,
    write_tensors,
)

KIND = "rl"
POLICY, ENCODER = "policy.", "encoder."  # what the tensors' names begin with


@dataclass(frozen=True)
class EncoderInfo:
    """How a frozen encoder is built, see `Backbone` and `Encoder`."""

    width: float
    batch_norm: bool
    image_size: tuple[int, int]
    ranges: tuple[float, ...]


@dataclass(frozen=True)
class PolicyInfo:
    """What is known of a policy: how it is built, its training's settings and seed, how many decisions it learnt from,
    its encoder, and the digest of the network whose affordances it learnt from."""

    policy: PolicyConfig
    training: dict[str, Any] = field(default_factory=dict)
    seed: int = 0
    steps: int = 0
    encoder: EncoderInfo | None = None
    perception: str | None = None


def save_policy(path: Path, policy: Policy, info: PolicyInfo, encoder: Encoder | None = None) -> None:
    """Write a policy and its encoder in 16 bits, whole or not at all."""
    tensors = {POLICY + name: value for name, value in policy.state_dict().items()}
    if encoder is not None:
        tensors |= {ENCODER + name: value for name, value in encoder.backbone.state_dict().items()}
    write_tensors(path, {k: v.half() if is_weight(v) else v for k, v in tensors.items()}, {"kind": KIND} | asdict(info))


def encoder_info(encoder: Encoder) -> EncoderInfo:
    """How an encoder is built, for a file's header."""
    has_norm = any(isinstance(module, nn.BatchNorm2d) for module in encoder.backbone.norms)
    return EncoderInfo(encoder.backbone.width, has_norm, encoder.image_size, encoder.ranges)


def read_policy_info(path: Path) -> PolicyInfo:
    """What is known of a policy; its weights are not read. Raises CheckpointError where the file is none."""
    header = read_header(path)
    require_kind(path, header, KIND)
    try:
        names = {part.name for part in fields(PolicyInfo)}
        return as_type({name: header[name] for name in header.keys() & names}, PolicyInfo)
    except (KeyError, TypeError, ValueError) as error:
        raise CheckpointError(
            f"found in {path} a header that cannot be read ({error}), wanted a training's: train the policy again"
        ) from error


def load_policy(path: Path) -> tuple[Policy, PolicyInfo, Encoder | None]:
    """Read a policy, ready to drive, what is known of it, and its encoder. Raises CheckpointError where the file is no
    policy, or does not fit this code."""
    info = read_policy_info(path)
    tensors = single_precision(read_tensors(path)[0], camera_check=False)
    policy, encoder = Policy(info.policy), None
    _load(path, policy, tensors, POLICY)
    if info.encoder is not None:
        known = info.encoder
        encoder = Encoder(Backbone(known.width, known.batch_norm), known.image_size, known.ranges)
        _load(path, encoder.backbone, tensors, ENCODER)
    elif info.policy.sees == "features":
        raise CheckpointError(f"found in {path} a policy without its encoder, wanted both: train the policy again")
    return policy.eval(), info, encoder


def _load(path: Path, module: nn.Module, tensors: dict[str, Tensor], prefix: str) -> None:
    """Raises CheckpointError where the tensors do not fit a module."""
    state = {name.removeprefix(prefix): value for name, value in tensors.items() if name.startswith(prefix)}
    try:
        module.load_state_dict(state)
    except RuntimeError as error:
        raise CheckpointError(
            f"found in {path} weights that do not fit its own settings, wanted those that do: train the policy again"
        ) from error
    if not all(bool(torch.isfinite(value).all()) for value in state.values()):
        raise CheckpointError(f"found in {path} weights that are not numbers, wanted a trained policy: train it again")
