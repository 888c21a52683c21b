"""Probabilities that mean what they say, after a training in which the rare was made frequent."""

from __future__ import annotations

import copy

import numpy as np
import torch
from numpy.typing import NDArray

from caldrive.perception.dataset import Frames
from caldrive.perception.network import Network
from caldrive.perception.specs import ClassWeights


def calibrated(
    network: Network, frames: Frames, drawn: dict[str, NDArray[np.float64]], weights: ClassWeights
) -> Network:
    """A copy of the network whose probabilities are those of the recording.

    Weighted and balanced, training sees rare classes as often as the others, and so the network expects them. Moving
    each class's last bias by the logarithm of (its share of the frames / its share of the loss) takes that back; about,
    as frames are drawn by the rarest of their labels, not by each. drawn: how often each class was (K,), by affordance.
    """
    network = copy.deepcopy(network)
    for name, weight in weights.items():
        count = torch.bincount(frames.targets[name], minlength=len(weight)).double()
        weighted = weight.cpu().double() * torch.from_numpy(drawn[name])
        shift = (count / weighted).nan_to_num(0.0).clamp(min=1e-9).log()  # what never occurs is not expected
        bias = network.get_parameter(f"blocks.{name}.groups.0.output.bias")
        bias.data += (shift - shift[0]).to(bias.device)
    return network
