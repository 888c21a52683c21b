"""The precision in which a network computes, and its backbone in each."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager, nullcontext
from typing import Any

import torch
from torch import Tensor

from caldrive.perception.network.checkpoint import CheckpointInfo
from caldrive.perception.network.network import Network

Features = Callable[[Tensor], Tensor]  # a backbone: normalised images (N, 3, H, W) to features (N, F)

# The task blocks: features (1, span, F) and a command (1,) to outputs (1, K) by affordance.
Blocks = Callable[[Tensor, Tensor], Mapping[str, Tensor]]
INTEGERS = ("int8", "int7")  # int7: weights have 7 bits
PRECISIONS = ("auto", "fp32", "bf16", *INTEGERS)


def _bf16_pays() -> bool:
    """Whether this processor multiplies bfloat16 faster than fp32: with AMX, or AVX512-BF16 on an AMD; Intel's cores
    without AMX take 1.7 times as long (one frame through the small network: 9.8 ms, in fp32 5.8 ms)."""
    able = torch.cpu.get_capabilities()
    return bool(able.get("amx_bf16") or (able.get("avx512_bf16") and "Intel" not in able.get("cpu_name", "")))


def _integers() -> str | None:
    """int8 where the processor adds products of bytes in 32 bits (VNNI), int7 where it adds pairs of them in 16, which
    weights of 8 bits would overflow; None where integers do not pay."""
    able = torch.cpu.get_capabilities()
    if any(able.get(name) for name in ("avx512_vnni", "avx_vnni", "amx_int8")):
        return "int8"
    return "int7" if able.get("avx2") else None


def use_bf16(precision: str, device: str) -> bool:
    """Whether to compute in bfloat16; `auto` does where that is faster than fp32."""
    if precision not in ("auto", "fp32", "bf16"):
        raise ValueError(f"precision is {precision!r}, but must be auto, fp32 or bf16 (int8 is for driving)")
    if precision != "auto":
        return precision == "bf16"
    return device != "cpu" or _bf16_pays()


def autocast(precision: str, device: str) -> AbstractContextManager[Any]:
    """The context in which the network computes."""
    return torch.autocast(device.split(":")[0], torch.bfloat16) if use_bf16(precision, device) else nullcontext()


def driving_precision(wanted: str, info: CheckpointInfo) -> str:
    """fp32, bf16, int8 or int7. `auto` is int8 or int7 where the network's ranges are known and the processor is fast
    with integers, else what is faster of the others.

    Raises ValueError for another word, and for integers without ranges.
    """
    if wanted not in PRECISIONS:
        raise ValueError(f"found precision {wanted!r}, wanted one of {', '.join(PRECISIONS)}: type --precision auto")
    if wanted in INTEGERS:
        if not info.ranges:
            raise ValueError("found a network without the ranges that int8 needs: train it anew, or take fp32")
        return wanted
    fastest = _integers() if wanted == "auto" and info.ranges else None
    return fastest or ("bf16" if use_bf16(wanted, "cpu") else "fp32")


def features_in(precision: str, network: Network, info: CheckpointInfo, threads: int | None = None) -> Features:
    """The backbone in fp32, bf16, int8 or int7 on the CPU; bf16 turns the network's own. threads: for integers, as many
    as torch has without it."""
    if precision in INTEGERS:
        from caldrive.perception.inference.openvino_engine import (
            Int8Backbone,  # with OpenVINO, which only integers need
        )

        config = network.config
        size = config.image_height, config.image_width
        threads = threads or torch.get_num_threads()
        return Int8Backbone(network.backbone, info.ranges, *size, threads, int(precision[-1]))
    dtype = torch.bfloat16 if precision == "bf16" else torch.float32
    network.backbone.to(dtype)
    return lambda images: network.features(images.to(dtype)).float()


def blocks_in(precision: str, network: Network, threads: int | None = None) -> Blocks:
    """The task blocks at the wheel: beside a backbone in integers they, too, pass OpenVINO, where it has their layers;
    two libraries would wait for each other's threads."""
    if precision in INTEGERS:
        from caldrive.perception.inference.openvino_engine import LAYERS, BlockGraphs

        if all(block.config.layer in LAYERS for block in network.task_blocks().values()):
            return BlockGraphs(network, threads or torch.get_num_threads())
    return network
