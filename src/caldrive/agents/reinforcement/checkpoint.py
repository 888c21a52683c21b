"""A policy on disk: one safetensors file with what the wheel needs, the frozen encoder included."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from torch import nn

from caldrive.agents.reinforcement.config import PolicyConfig
from caldrive.agents.reinforcement.encoder import Encoder
from caldrive.agents.reinforcement.policy import Policy
from caldrive.perception.network.backbone import Backbone
from caldrive.perception.network.tensor_file import (
    CheckpointError,
    in_single_precision,
    is_weight,
    load_state,
    read_known,
    read_tensors,
    require_shapes,
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
    return read_known(path, KIND, PolicyInfo)


def load_policy(path: Path) -> tuple[Policy, PolicyInfo, Encoder | None]:
    """Read a policy, ready to drive, what is known of it, and its encoder. Raises CheckpointError where the file is no
    policy, or does not fit this code."""
    info = read_policy_info(path)
    if info.encoder is None and info.policy.sees == "features":
        raise CheckpointError(f"found in {path} a policy without its encoder, wanted both: train the policy again")
    require_shapes(path, lambda: _build(info))
    parts = _build(info)
    load_state(path, parts, in_single_precision(read_tensors(path)[0]))
    policy, encoder = parts["policy"], None
    assert isinstance(policy, Policy)
    if info.encoder is not None:
        backbone = parts["encoder"]
        assert isinstance(backbone, Backbone)
        encoder = Encoder(backbone, info.encoder.image_size, info.encoder.ranges)
    return policy, info, encoder


def _build(info: PolicyInfo) -> nn.ModuleDict:
    """A policy and its encoder, as `save_policy` names their tensors."""
    parts: dict[str, nn.Module] = {"policy": Policy(info.policy)}
    if info.encoder is not None:
        parts["encoder"] = Backbone(info.encoder.width, info.encoder.batch_norm)
    return nn.ModuleDict(parts)
