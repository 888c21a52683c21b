"""A network's figures on recorded frames."""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor

from caldrive.perception.dataset import Frames
from caldrive.perception.images import normalise, to_float
from caldrive.perception.network import Network
from caldrive.perception.precision import Features, autocast
from caldrive.perception.specs import Outputs, Targets, losses, metrics
from caldrive.progress import Progress, silent

BATCH = 128  # frames that are evaluated together


@torch.no_grad()
def outputs_on(
    network: Network,
    frames: Frames,
    features: Features,
    device: str = "cpu",
    progress: Progress = silent,
    context: int | None = None,
) -> tuple[Outputs, Targets]:
    """Outputs (N, K) and targets (N,) on all frames. features: the network's backbone; context: frames of history that
    it sees, without it as many as its blocks look at."""
    network.eval()
    context = network.span - 1 if context is None else context
    outputs, targets = [], []
    for first in range(0, len(frames), BATCH):
        batch = frames.batch(np.arange(first, min(first + BATCH, len(frames))), 1, context)
        seen = features(normalise(to_float(batch.images)).to(device)).float()
        outputs.append(network(seen[batch.index.to(device)], batch.command.to(device)))
        targets.append(batch.targets)
        progress("evaluating", first / len(frames))
    joined = {name: torch.cat([o[name].float().cpu() for o in outputs]) for name in outputs[0]}
    return joined, {name: torch.cat([t[name] for t in targets]) for name in targets[0]}


def evaluate(
    network: Network, frames: Frames, precision: str = "auto", device: str = "cpu", context: int | None = None
) -> dict[str, float]:
    """Metrics over all frames, and each affordance's unweighted loss as `<name>/loss`, their sum as `loss`."""

    def features(images: Tensor) -> Tensor:
        with autocast(precision, device):
            return network.features(images)

    outputs, targets = outputs_on(network, frames, features, device, context=context)
    parts = {f"{name}/loss": float(value) for name, value in losses(outputs, targets).items()}
    return {"loss": sum(parts.values())} | parts | metrics(outputs, targets)
