"""Calibration of a trained network: of its probabilities, as rare classes were drawn often, and for 8-bit integers."""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence

import torch
from torch import Tensor, nn

from caldrive.perception.network.network import Network

IMAGES_A_PASS = 16
Counts = Mapping[str, Sequence[int]]  # frames of each class (K,), by discrete affordance


def calibrated(network: Network, counts: Counts) -> Network:
    """A copy of the network whose probabilities are those of the recording.

    Weighted by the inverse of how often they are drawn, all classes count the same in training, and so the network
    expects them alike. Moving each class's last bias by the logarithm of its share of the frames takes that back;
    about, as frames are drawn by the rarest of their labels, not by each. counts: of the recording.
    """
    return _with_prior(network, counts, 1.0)


def uncalibrated(network: Network, counts: Counts) -> Network:
    """A copy of a calibrated network as it was before, to be trained further. counts: those of its own recording."""
    return _with_prior(network, counts, -1.0)


def _with_prior(network: Network, counts: Counts, sign: float) -> Network:
    """A copy whose biases have the logarithms of the classes' shares added (sign 1) or taken away (-1)."""
    network = copy.deepcopy(network)
    for name, count in counts.items():
        frames = torch.tensor(count, dtype=torch.float64)
        prior = (frames / frames.sum()).clamp(min=1e-9).log()  # what never occurs is not expected
        bias = network.get_parameter(f"blocks.{name}.groups.0.output.bias")
        bias.data += sign * (prior - prior[0]).to(bias.device)
    return network


@torch.no_grad()
def input_ranges(seeing: nn.Module, images: Tensor) -> tuple[float, ...]:
    """For each convolution of what sees, in their order, the largest size of what enters it as images (N, 3, H, W)
    pass, normalised as it takes them.

    Nothing is clipped, though that would make the steps of 8 bits finer: the few largest values are lamps and signs.
    """
    sizes: list[list[float]] = []  # of each pass, by convolution

    def note(module: nn.Module, inputs: tuple[Tensor, ...]) -> None:
        sizes[-1].append(float(inputs[0].abs().max()))

    convolutions = [module for module in seeing.modules() if isinstance(module, nn.Conv2d)]
    hooks = [conv.register_forward_pre_hook(note) for conv in convolutions]
    try:
        for part in torch.split(images, IMAGES_A_PASS):
            sizes.append([])
            seeing(part)
    finally:
        for hook in hooks:
            hook.remove()
    return tuple(map(max, zip(*sizes, strict=True)))
