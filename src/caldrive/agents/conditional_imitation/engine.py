"""What the imitation network makes of an image when driving: in 8-bit integers through OpenVINO, or by torch."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import torch
from torch import Tensor, nn

from caldrive.agents.conditional_imitation.network import ImitationNetwork
from caldrive.datatypes import Image
from caldrive.perception.images import gain_and_shift, to_float
from caldrive.perception.inference.engines import INTEGERS, autocast
from caldrive.perception.inference.openvino_engine import (
    Graph,
    backbone_graph,
    convolution,
    image_graph,
    linear,
    normalised,
    ops,
    require_trained,
)
from caldrive.perception.network.backbone import Backbone

ImageEngine = Callable[[Image], Tensor]  # an image (H, W, 3) in bytes to (1, nodes)
AS_SHARES = (1 / 255,) * 3, (0.0,) * 3  # gain and shift of images in [0, 1]


def image_engine(network: ImitationNetwork, precision: str, ranges: Sequence[float], threads: int) -> ImageEngine:
    """The network's way from an image to the layer that is joined with the speed. precision: fp32, bf16, int8 or int7,
    which needs ranges, by `calibration.input_ranges`."""
    if precision in INTEGERS:
        return _integers(network, ranges, INTEGERS[precision], threads)

    @torch.inference_mode()
    def look(image: Image) -> Tensor:
        with autocast(precision, "cpu"):
            result: Tensor = network.image(network.trunk(network.prepared(to_float(image[None]))))
        return result.float()

    return look


def _integers(network: ImitationNetwork, ranges: Sequence[float], bits: int, threads: int) -> ImageEngine:
    require_trained(network.trunk, ranges)
    is_backbone = isinstance(network.trunk, Backbone)
    image, x = image_graph(network.config.image_size, *(gain_and_shift() if is_backbone else AS_SHARES))
    if isinstance(network.trunk, Backbone):
        x = backbone_graph(x, network.trunk, ranges, bits)
    else:
        x = _published_graph(x, network.trunk, ranges, bits)
    for layer in network.image:
        if isinstance(layer, nn.Linear):
            x = ops.relu(linear(x, layer))
    graph = Graph([x], image, threads)
    return lambda picture: torch.from_numpy(graph(picture[None])[0])


def _published_graph(x: Any, trunk: nn.Module, ranges: Sequence[float], bits: int) -> Any:
    """The eight convolutions' features (1, F) of an image (1, 3, H, W)."""
    assert isinstance(trunk, nn.Sequential)
    layers = list(trunk)
    for number, (conv, norm) in enumerate(zip(layers[0:-1:3], layers[1:-1:3], strict=True)):
        x = convolution(x, conv, ranges[number], signed=False, bits=bits)
        x = ops.relu(normalised(x, norm, 1, -1, 1, 1))
    return ops.reshape(x, ops.constant([1, -1]), False)
