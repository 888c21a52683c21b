"""A network's figures on recorded frames, and the precision in which it computes them."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from typing import Any

import numpy as np
import torch
from torch import Tensor

from caldrive.perception.dataset import Batch, Frames, Ids
from caldrive.perception.images import normalise, to_float
from caldrive.perception.network import Network
from caldrive.perception.sampler import every_window
from caldrive.perception.specs import Outputs, Targets, losses, metrics

BATCH = 128  # frames that are evaluated together
Done = Callable[[float], None]  # told the share that is done


def unwatched(share: float) -> None:
    """Progress that nobody follows."""


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


def outputs_of(network: Network, batch: Batch, images: Tensor, device: str) -> dict[str, Tensor]:
    """Normalised images (N, 3, H, W) of a batch to outputs (B * S, K)."""
    return network.on_windows(images.to(device), batch.index.to(device), batch.command.to(device))


@torch.no_grad()
def outputs_on(
    network: Network, frames: Frames, precision: str = "auto", device: str = "cpu", progress: Done = unwatched
) -> tuple[Ids, Outputs, Targets]:
    """Numbers (N,) of all frames, outputs (N, K) and targets (N,) on them."""
    network.eval()
    ids, outputs, targets = [], [], []
    for starts in every_window(frames, 1, BATCH):
        batch = frames.batch(starts, 1, network.span - 1)
        with autocast(precision, device):
            outputs.append(outputs_of(network, batch, normalise(to_float(batch.images)), device))
        ids.append(starts)
        targets.append(batch.targets)
        progress(float(starts[-1]) / len(frames))
    joined = {name: torch.cat([o[name].float().cpu() for o in outputs]) for name in outputs[0]}
    return np.concatenate(ids), joined, {name: torch.cat([t[name] for t in targets]) for name in targets[0]}


def evaluate(network: Network, frames: Frames, precision: str = "auto", device: str = "cpu") -> dict[str, float]:
    """Metrics over all frames, and each affordance's unweighted loss as `<name>/loss`, their sum as `loss`."""
    _, outputs, targets = outputs_on(network, frames, precision, device)
    parts = {f"{name}/loss": float(value) for name, value in losses(outputs, targets).items()}
    return {"loss": sum(parts.values())} | parts | metrics(outputs, targets)
