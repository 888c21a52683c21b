"""What the network learns: affordances as targets, their losses, and outputs turned back into affordances.

A target is a class number (int64) or a value divided by its scale (float32), each (N,). An output is what the network
gives: logits (N, K) of K classes or scaled values (N, 1).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.nn import functional

from caldrive.affordances import SPECS, AffordanceSpec
from caldrive.datatypes import Affordances

Outputs = Mapping[str, Tensor]
Targets = Mapping[str, Tensor]
ClassWeights = Mapping[str, Tensor]
MOST_ODDS = 700.0  # logarithm of odds: e to the power of more is no number


def encode(spec: AffordanceSpec, values: NDArray[Any]) -> Tensor:
    """Labels (N,) in SI units (a speed sign in km/h, 0 for none) as targets (N,)."""
    if not spec.discrete:
        return torch.from_numpy(np.clip(values, spec.low, spec.high) / spec.scale).float()
    nearest = np.abs(np.asarray(values, dtype=float)[:, None] - np.array(spec.classes)).argmin(axis=1)
    return torch.from_numpy(nearest)


def si_values(spec: AffordanceSpec, output: Tensor) -> Tensor:
    """Outputs (N, 1) as values (N,) in SI units, clipped to the affordance's range."""
    return (output[:, 0].float() * spec.scale).clamp(spec.low, spec.high)


def si_error(spec: AffordanceSpec, output: Tensor, target: Tensor) -> Tensor:
    """Absolute errors (N,) of outputs (N, 1) in SI units; a value beyond the range counts as its end."""
    return (si_values(spec, output) - target * spec.scale).abs()


def scaled_error(spec: AffordanceSpec, output: Tensor, target: Tensor) -> Tensor:
    """Absolute errors (N,) of scaled outputs (N, 1). A target at a limit of the range stands for all beyond it, as
    decoding does: an output there is right."""
    beyond = (target >= spec.high / spec.scale) & (output[:, 0] > target)
    beyond |= (target <= spec.low / spec.scale) & (output[:, 0] < target)
    return (output[:, 0] - target).abs().masked_fill(beyond, 0.0)


def decode(outputs: Mapping[str, Tensor | NDArray[np.float32]]) -> Affordances:
    """Outputs with N = 1, of torch or numpy, as affordances: probabilities by softmax, the likeliest sign, values in SI
    units."""
    values: dict[str, Any] = {}
    for spec in SPECS:
        output: list[float] = outputs[spec.name][0].tolist()
        if spec.binary:
            values[spec.name] = 1 / (1 + math.exp(min(output[0] - output[1], MOST_ODDS)))
        elif spec.discrete:
            values[spec.name] = spec.classes[output.index(max(output))] or None
        else:
            values[spec.name] = min(max(output[0] * spec.scale, spec.low), spec.high)
    return Affordances(**values)


def class_weights(counts: Mapping[str, NDArray[np.float64]]) -> dict[str, Tensor]:
    """Weights (K,) inverse to the classes' counts, with mean 1 over the samples; a class that never occurs weighs 0."""
    weights = {}
    for name, count in counts.items():
        inverse = np.where(count > 0, 1 / np.maximum(count, 1e-9), 0.0)
        weights[name] = torch.from_numpy(inverse * count.sum() / (inverse * count).sum()).float()
    return weights


def task_losses(outputs: Outputs, targets: Targets, weights: ClassWeights | None = None) -> dict[str, Tensor]:
    """The loss of each affordance among the outputs: class-weighted cross-entropy, or mean absolute error of the scaled
    value (section 3.1), where a target at a limit stands for all beyond it."""
    parts = {}
    for spec in (spec for spec in SPECS if spec.name in outputs):
        output, target = outputs[spec.name].float(), targets[spec.name]
        if spec.discrete:
            weight = None if weights is None else weights[spec.name]
            # The mean over samples, not over weights: a batch's few rare samples must not take all of its gradient.
            parts[spec.name] = functional.cross_entropy(output, target, weight, reduction="none").mean()
        else:
            parts[spec.name] = scaled_error(spec, output, target).mean()
    return parts


def multitask_loss(
    outputs: Outputs,
    targets: Targets,
    weights: ClassWeights | None = None,
    task_weights: Mapping[str, float] | None = None,
) -> Tensor:
    """The losses of all affordances among the outputs, added. task_weights: what each counts; without them 1."""
    parts = task_losses(outputs, targets, weights)
    if task_weights is not None:
        parts = {name: task_weights[name] * part for name, part in parts.items()}
    return torch.stack(list(parts.values())).sum()
