"""What is put right when a training ends: probabilities, as the rare was made frequent, and the ranges of 8 bits."""

from __future__ import annotations

import copy

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from caldrive.perception.backbone import Backbone
from caldrive.perception.dataset import Frames
from caldrive.perception.network import Network
from caldrive.perception.specs import ClassWeights

AT_ONCE = 16  # images


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


@torch.no_grad()
def input_ranges(backbone: Backbone, images: Tensor) -> tuple[float, ...]:
    """For each convolution the largest size of what enters it as normalised images (N, 3, H, W) pass.

    Nothing is clipped, though that would make the steps of 8 bits finer: the few largest values are lamps and signs.
    """
    found: list[list[float]] = []

    def note(module: nn.Module, inputs: tuple[Tensor, ...]) -> None:
        found[-1].append(float(inputs[0].abs().max()))

    hooks = [conv.register_forward_pre_hook(note) for conv in backbone.convolutions()]
    try:
        for part in torch.split(images, AT_ONCE):
            found.append([])
            backbone(part)
    finally:
        for hook in hooks:
            hook.remove()
    return tuple(map(max, zip(*found, strict=True)))
