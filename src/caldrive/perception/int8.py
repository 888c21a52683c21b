"""The backbone in 8-bit integers through OpenVINO: on a CPU with VNNI four times as fast as torch in 32 bits,
on older ones twice.

Post-training quantization (Jacob et al. 2018): weights have a scale for each channel that they give; what enters a
convolution has one scale, found on recorded images (`calibration.input_ranges`).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import torch
from torch import Tensor, nn

from caldrive.perception.backbone import Backbone
from caldrive.perception.graphs import compiled, constant, normalised, ops


def _rounded(x: Any, top: Any, signed: bool, levels: int) -> Any:
    """x rounded to that many levels in [-top, top], or in [0, top]."""
    low = -top * (levels // 2) / ((levels - 1) // 2) if signed else 0.0 * top
    return ops.fake_quantize(x, np.float32(low), np.float32(top), np.float32(low), np.float32(top), levels)


def _convolution(x: Any, conv: nn.Module, top: float, signed: bool, bits: int) -> Any:
    assert isinstance(conv, nn.Conv2d)
    weight = conv.weight.detach().float().numpy()
    tops = np.abs(weight).max(axis=(1, 2, 3), keepdims=True) * 2 ** (8 - bits)  # of 8 bits only the lower ones are used
    weight = _rounded(ops.constant(np.ascontiguousarray(weight)), np.maximum(tops, 1e-9), True, 255)
    x = ops.convolution(_rounded(x, np.float32(top), signed, 256), weight, [1, 1], [1, 1], [1, 1], [1, 1])
    assert conv.bias is not None
    return ops.add(x, constant(conv.bias, 1, -1, 1, 1))


def _graph(image: Any, backbone: Backbone, ranges: Sequence[float], bits: int) -> Any:
    """The backbone's features (1, F) of an image (1, 3, H, W); its fake quantizations become integers when it is
    compiled."""
    x = image
    number = 0
    for stage, norm in zip(backbone.stages, backbone.norms, strict=True):
        assert isinstance(stage, nn.ModuleList)
        for conv in stage:
            if conv is not stage[0]:
                x = ops.relu(x)
            x = _convolution(x, conv, ranges[number], signed=number == 0, bits=bits)
            number += 1
        x = ops.max_pool(x, [2, 2], [1, 1], [0, 0], [0, 0], [2, 2], "floor").output(0)
        x = ops.relu(normalised(x, norm, 1, -1, 1, 1))
    return ops.reshape(x, ops.constant([1, -1]), False)


class Int8Backbone:
    """A trained backbone on the CPU for images of one size. ranges: by `input_ranges`; threads: how many it may use;
    bits: of a weight, 7 for a processor that adds pairs of products in 16 bits.

    Raises ValueError where the ranges are not this backbone's, or where they or its weights are not numbers.
    """

    def __init__(
        self, backbone: Backbone, ranges: Sequence[float], height: int, width: int, threads: int, bits: int = 8
    ) -> None:
        if len(ranges) != len(backbone.convolutions()):
            raise ValueError(
                f"found {len(ranges)} ranges, wanted {len(backbone.convolutions())}: train the network anew"
            )
        if not all(bool(torch.as_tensor(one).isfinite().all()) for one in (ranges, *backbone.state_dict().values())):
            raise ValueError("found weights that are not numbers, which integers would hide: train the network anew")
        image = ops.parameter([1, 3, height, width], np.float32)
        self._request = compiled([_graph(image, backbone, ranges, bits)], image, threads)

    def __call__(self, images: Tensor) -> Tensor:
        """Normalised images (N, 3, H, W), which pass one at a time, to features (N, F)."""
        found = [self._request.infer([image], share_inputs=True)[0] for image in images.numpy()[:, None]]
        return torch.from_numpy(np.concatenate(found))
