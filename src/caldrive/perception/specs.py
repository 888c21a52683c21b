"""The table of the affordances (Fig. 3): one row drives encoding, loss, metrics and decoding of its affordance.

Targets are what the network learns: a class number (int64) or a value divided by its scale (float32), each (N,).
Outputs are what it gives: logits (N, K) of K classes or scaled values (N, 1).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.nn import functional

from caldrive.datatypes import MAX_CENTER_DISTANCE, MAX_VEHICLE_DISTANCE, SPEED_SIGNS, Affordances

Outputs = Mapping[str, Tensor]
Targets = Mapping[str, Tensor]
ClassWeights = Mapping[str, Tensor]


@dataclass(frozen=True)
class Spec:
    """One affordance: its classes (0 stands for none or false), or its scale and range; whether the command switches
    it."""

    name: str
    classes: tuple[int, ...] = ()
    scale: float = 1.0
    low: float = 0.0
    high: float = 1.0
    conditional: bool = False
    unit: str = ""

    @property
    def discrete(self) -> bool:
        return bool(self.classes)

    @property
    def outputs(self) -> int:
        """Output nodes of one group."""
        return len(self.classes) or 1

    def encode(self, values: NDArray[Any]) -> Tensor:
        """Labels (N,) in SI units (a speed sign in km/h, 0 for none) as targets (N,)."""
        if not self.discrete:
            return torch.from_numpy(np.clip(values, self.low, self.high) / self.scale).float()
        nearest = np.abs(np.asarray(values, dtype=float)[:, None] - np.array(self.classes)).argmin(axis=1)
        return torch.from_numpy(nearest)

    def decode(self, output: Tensor) -> Tensor:
        """Outputs (N, 1) as values (N,) in SI units, clipped to the affordance's range."""
        return (output[:, 0].float() * self.scale).clamp(self.low, self.high)

    def error(self, output: Tensor, target: Tensor) -> Tensor:
        """Absolute errors (N,) of scaled outputs (N, 1). A target at a limit of the range stands for all beyond it, as
        decoding does: an output there is right."""
        beyond = (target >= self.high / self.scale) & (output[:, 0] > target)
        beyond |= (target <= self.low / self.scale) & (output[:, 0] < target)
        return (output[:, 0] - target).abs().masked_fill(beyond, 0.0)


SPECS = (
    Spec("hazard_stop", classes=(0, 1)),
    Spec("red_light", classes=(0, 1)),
    Spec("speed_sign", classes=(0, *SPEED_SIGNS), unit="km/h"),
    Spec("vehicle_distance", scale=50.0, high=MAX_VEHICLE_DISTANCE, unit="m"),
    Spec("relative_angle", scale=0.759, low=-math.pi, high=math.pi, conditional=True, unit="rad"),
    Spec("center_distance", scale=1.65, low=-MAX_CENTER_DISTANCE, high=MAX_CENTER_DISTANCE, conditional=True, unit="m"),
)


def describe() -> list[dict[str, Any]]:
    """The table in plain values, as a checkpoint keeps it."""
    return [asdict(spec) | {"classes": list(spec.classes)} for spec in SPECS]


def decode(outputs: Outputs) -> Affordances:
    """Outputs with N = 1 as affordances: probabilities by softmax, the likeliest sign, values in SI units."""
    values: dict[str, Any] = {}
    for spec in SPECS:
        output = outputs[spec.name]
        if spec.outputs > 2:
            values[spec.name] = spec.classes[int(output[0].argmax())] or None
        elif spec.discrete:
            values[spec.name] = float(output[0].float().softmax(0)[1])
        else:
            values[spec.name] = float(spec.decode(output)[0])
    return Affordances(**values)


def class_weights(counts: Mapping[str, NDArray[np.float64]]) -> dict[str, Tensor]:
    """Weights (K,) inverse to the classes' counts, with mean 1 over the samples; a class that never occurs weighs 0."""
    weights = {}
    for name, count in counts.items():
        inverse = np.where(count > 0, 1 / np.maximum(count, 1e-9), 0.0)
        weights[name] = torch.from_numpy(inverse * count.sum() / (inverse * count).sum()).float()
    return weights


def losses(outputs: Outputs, targets: Targets, weights: ClassWeights | None = None) -> dict[str, Tensor]:
    """The loss of each affordance among the outputs: class-weighted cross-entropy, or mean absolute error of the scaled
    value (section 3.1), where a target at a limit stands for all beyond it."""
    result = {}
    for spec in (spec for spec in SPECS if spec.name in outputs):
        output, target = outputs[spec.name].float(), targets[spec.name]
        if spec.discrete:
            weight = None if weights is None else weights[spec.name]
            # The mean over samples, not over weights: a batch's few rare samples must not take all of its gradient.
            result[spec.name] = functional.cross_entropy(output, target, weight, reduction="none").mean()
        else:
            result[spec.name] = spec.error(output, target).mean()
    return result


def loss(outputs: Outputs, targets: Targets, weights: ClassWeights | None = None, angle_weight: float = 1.0) -> Tensor:
    """The whole loss: those of all affordances added, the relative angle's times angle_weight."""
    parts = losses(outputs, targets, weights)
    if "relative_angle" in parts:
        parts["relative_angle"] = angle_weight * parts["relative_angle"]
    return torch.stack(list(parts.values())).sum()


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
            error = float((spec.decode(output) - target * spec.scale).abs().mean())
            result[f"{spec.name}/mae"] = error
            result[f"{spec.name}/mae_scaled"] = error / spec.scale
    return result
