"""A network's outputs on recorded frames, and its metrics there: mean IoU and MAE, as in the paper's supplement."""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor

from caldrive.affordances import SPECS
from caldrive.perception.dataset.frames import Frames
from caldrive.perception.images import normalise, to_float
from caldrive.perception.inference.engines import BackboneEngine, autocast
from caldrive.perception.network.network import Network
from caldrive.perception.targets import Outputs, Targets, si_error, task_losses
from caldrive.progress import Progress, silent

FRAMES_A_PASS = 128


def confusion(predicted: Tensor, target: Tensor, n_classes: int) -> Tensor:
    """How many of the samples (N,) of each true class (row) were seen as each class (column)."""
    return torch.bincount(target * n_classes + predicted, minlength=n_classes**2).view(n_classes, n_classes)


def class_ious(counts: Tensor) -> list[float | None]:
    """Intersection over union of predicted and true samples of each class, by the counts (K, K) of `confusion`; None
    for a class that never occurred, neither in truth nor predicted."""
    hits = counts.double().diagonal()
    unions = counts.double().sum(0) + counts.double().sum(1) - hits
    return [float(hit / union) if union else None for hit, union in zip(hits, unions, strict=True)]


def mean_iou(predicted: Tensor, target: Tensor, n_classes: int) -> float | None:
    """Mean of `class_ious` over the classes that occur among samples (N,). None where only one does: who always says
    the same of what is always the same has shown nothing."""
    occurring = [iou for iou in class_ious(confusion(predicted, target, n_classes)) if iou is not None]
    return float(torch.tensor(occurring, dtype=torch.float64).mean()) if len(occurring) > 1 else None


def metrics(outputs: Outputs, targets: Targets) -> dict[str, float | None]:
    """`<name>/iou` for the discrete, by `mean_iou`; `<name>/mae` in SI units and `<name>/mae_scaled` for the continuous
    affordances."""
    figures: dict[str, float | None] = {}
    for spec in SPECS:
        output, target = outputs[spec.name], targets[spec.name]
        if spec.discrete:
            figures[spec.metric] = mean_iou(output.argmax(1), target, spec.outputs)
        else:
            error = float(si_error(spec, output, target).mean())
            figures[spec.metric] = error
            figures[f"{spec.metric}_scaled"] = error / spec.scale
    return figures


@torch.no_grad()
def outputs_on(
    network: Network,
    frames: Frames,
    backbone: BackboneEngine,
    device: str = "cpu",
    progress: Progress = silent,
    context: int | None = None,
) -> tuple[Outputs, Targets]:
    """Outputs (N, K) and targets (N,) on all frames. backbone: the network's, in some precision; context: frames of
    history that it sees, without it as many as its blocks look at."""
    network.eval()
    context = network.span - 1 if context is None else context
    outputs, targets = [], []
    for first in range(0, len(frames), FRAMES_A_PASS):
        starts = np.arange(first, min(first + FRAMES_A_PASS, len(frames)))
        batch = frames.batch(starts, window=1, context=context)
        features = backbone(normalise(to_float(batch.images)).to(device)).float()
        outputs.append(network(features[batch.index.to(device)], batch.command.to(device)))
        targets.append(batch.targets)
        progress("evaluating", first / len(frames))
    joined = {name: torch.cat([part[name].float().cpu() for part in outputs]) for name in outputs[0]}
    return joined, {name: torch.cat([part[name] for part in targets]) for name in targets[0]}


def evaluate(
    network: Network, frames: Frames, precision: str = "auto", device: str = "cpu", context: int | None = None
) -> dict[str, float]:
    """The metrics over all frames, where they show any, and each affordance's unweighted loss as `<name>/loss`, their
    sum as `loss`.

    precision: auto, fp32 or bf16. context: as in `outputs_on`.
    """

    def backbone(images: Tensor) -> Tensor:
        with autocast(precision, device):
            return network.features(images)

    outputs, targets = outputs_on(network, frames, backbone, device, context=context)
    losses = {f"{name}/loss": float(value) for name, value in task_losses(outputs, targets).items()}
    figures = {name: value for name, value in metrics(outputs, targets).items() if value is not None}
    return {"loss": sum(losses.values())} | losses | figures
