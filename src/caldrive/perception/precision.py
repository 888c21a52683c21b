"""The precision in which a network computes, and its backbone in each."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from typing import Any

import torch
from torch import Tensor

from caldrive.perception.checkpoint import CheckpointInfo
from caldrive.perception.network import Network

See = Callable[[Tensor], Tensor]  # normalised images (N, 3, H, W) to features (N, F)


def _bf16_pays() -> bool:
    """Whether this processor multiplies bfloat16 faster than fp32: with AMX, or AVX512-BF16 on an AMD; Intel's cores
    without AMX take 1.7 times as long (one frame through the small network: 9.8 ms, in fp32 5.8 ms)."""
    able = torch.cpu.get_capabilities()
    return bool(able.get("amx_bf16") or (able.get("avx512_bf16") and "Intel" not in able.get("cpu_name", "")))


def use_bf16(precision: str, device: str) -> bool:
    """Whether to compute in bfloat16; `auto` does where that is faster than fp32."""
    if precision not in ("auto", "fp32", "bf16"):
        raise ValueError(f"precision is {precision!r}, but must be auto, fp32 or bf16 (int8 only drives)")
    if precision != "auto":
        return precision == "bf16"
    return device != "cpu" or _bf16_pays()


def autocast(precision: str, device: str) -> AbstractContextManager[Any]:
    """The context in which the network computes."""
    return torch.autocast(device.split(":")[0], torch.bfloat16) if use_bf16(precision, device) else nullcontext()


def resolve(precision: str, info: CheckpointInfo) -> str:
    """fp32, bf16 or int8. `auto` is int8 where the network's ranges are known, else what is faster of the others.

    Raises ValueError for another word, and for int8 without ranges.
    """
    if precision == "int8" and not info.ranges:
        raise ValueError("found a network without the ranges that int8 needs: train it anew, or take fp32")
    if precision == "int8" or (precision == "auto" and info.ranges):
        return "int8"
    return "bf16" if use_bf16(precision, "cpu") else "fp32"


def seeing(network: Network, info: CheckpointInfo, precision: str) -> See:
    """The backbone in fp32, bf16 or int8 on the CPU."""
    if precision == "int8":
        from caldrive.perception.int8 import Int8Backbone  # with OpenVINO, which nothing else needs

        config = network.config
        size = config.image_height, config.image_width
        return Int8Backbone(network.backbone, info.ranges, *size, torch.get_num_threads())
    dtype = torch.bfloat16 if precision == "bf16" else torch.float32
    network.backbone.to(dtype)
    return lambda images: network.features(images.to(dtype)).float()
