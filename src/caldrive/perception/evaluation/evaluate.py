"""The table of the affordances (Fig. 3): one row drives encoding, loss, metrics and decoding of its affordance.

Targets are what the network learns: a class number (int64) or a value divided by its scale (float32), each (N,).
Outputs are what it gives: logits (N, K) of K classes or scaled values (N, 1).
"""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor

from caldrive.affordances import SPECS
from caldrive.perception.dataset.frames import Frames
from caldrive.perception.images import normalise, to_float
from caldrive.perception.inference.engines import Features, autocast
from caldrive.perception.network.network import Network
from caldrive.perception.targets import Outputs, Targets, losses, si_values
from caldrive.progress import Progress, silent


def confusion(predicted: Tensor, target: Tensor, n_classes: int) -> Tensor:
    """How many of the samples (N,) of each true class (row) were seen as each class (column)."""
    return torch.bincount(target * n_classes + predicted, minlength=n_classes**2).view(n_classes, n_classes)


def mean_iou(predicted: Tensor, target: Tensor, n_classes: int) -> float:
    """Mean over the classes that occur of intersection over union of predicted and true samples (N,)."""
    counts = confusion(predicted, target, n_classes).double()
    hits = counts.diagonal()
    union = counts.sum(0) + counts.sum(1) - hits
    return float((hits[union > 0] / union[union > 0]).mean())


def metrics(outputs: Outputs, targets: Targets) -> dict[str, float]:
    """`<name>/iou` for the discrete; `<name>/mae` in SI units and `<name>/mae_scaled` for the continuous
    affordances."""
    result: dict[str, float] = {}
    for spec in SPECS:
        output, target = outputs[spec.name], targets[spec.name]
        if spec.discrete:
            result[f"{spec.name}/iou"] = mean_iou(output.argmax(1), target, spec.outputs)
        else:
            error = float((si_values(spec, output) - target * spec.scale).abs().mean())
            result[f"{spec.name}/mae"] = error
            result[f"{spec.name}/mae_scaled"] = error / spec.scale
    return result


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
