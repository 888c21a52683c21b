"""A finished network driving through OpenVINO: the backbone in 8-bit integers, the camera check in 32 bits.

On a CPU with VNNI the backbone is four times as fast as torch in 32 bits, on older ones twice. Post-training
quantization (Jacob et al. 2018): weights have a scale for each channel that they give; what enters a convolution has
one scale, found on recorded images (`calibration.input_ranges`).
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from caldrive.compiled import Floats
from caldrive.datatypes import Image
from caldrive.perception.images import gain_and_shift
from caldrive.perception.network.backbone import Backbone
from caldrive.perception.network.camera_check import CameraCheck
from caldrive.perception.network.network import Network

# OpenVINO's converter, which nobody needs here, tells its makers over the network when it is imported. None in its
# place keeps it out, and the rest works without it.
sys.modules.setdefault("openvino.tools.ovc", None)  # type: ignore[arg-type]
import openvino as ov  # noqa: E402
from openvino import opset13  # noqa: E402

ops: Any = opset13


class Graph:
    """Compiled outputs of one parameter, for one input after the other.

    Inputs are copied to where OpenVINO reads them and outputs from where it writes them: its own ways in and out take
    another millisecond of a step.
    """

    def __init__(self, outputs: list[Any], parameter: Any, threads: int) -> None:
        settings = {
            "INFERENCE_NUM_THREADS": threads, "INFERENCE_PRECISION_HINT": "f32", "PERFORMANCE_HINT": "LATENCY",
            "ENABLE_CPU_PINNING": False,
        }  # fmt: skip
        model = ov.Model(outputs, [parameter])
        self._request = ov.Core().compile_model(model, "CPU", settings).create_infer_request()
        self._input = self._request.get_input_tensor(0).data
        self._outputs = [self._request.get_output_tensor(k).data for k in range(len(outputs))]

    def __call__(self, values: NDArray[Any]) -> list[Floats]:
        """The outputs for values of the parameter's shape and type."""
        self._input[...] = values
        self._request.infer(share_outputs=True)
        return [output.copy() for output in self._outputs]


def constant(values: Tensor, *shape: int) -> Any:
    """Trained values in 32 bits, in another shape where one is given."""
    array: NDArray[np.float32] = values.detach().float().numpy()
    return ops.constant(np.ascontiguousarray(array.reshape(shape) if shape else array))


def normalised(x: Any, norm: nn.Module, *shape: int) -> Any:
    """Batch norm by its running statistics, with gain and shift of this shape; anything else leaves x as it is."""
    if not isinstance(norm, nn.BatchNorm2d):
        return x
    assert norm.running_var is not None
    assert norm.running_mean is not None
    gain = norm.weight / (norm.running_var + norm.eps).sqrt()
    shift = norm.bias - norm.running_mean * gain
    return ops.add(ops.multiply(x, constant(gain, *shape)), constant(shift, *shape))


def _quantized(x: Any, high: Any, signed: bool, levels: int) -> Any:
    """x rounded to that many levels in [-high, high], or in [0, high]."""
    low = -high * (levels // 2) / ((levels - 1) // 2) if signed else 0.0 * high
    return ops.fake_quantize(x, np.float32(low), np.float32(high), np.float32(low), np.float32(high), levels)


def convolution(x: Any, conv: nn.Module, high: float, signed: bool, bits: int) -> Any:
    """A convolution in integers. high: the largest size of what enters; signed: whether that is also negative."""
    assert isinstance(conv, nn.Conv2d)
    weight = conv.weight.detach().float().numpy()
    highs = np.abs(weight).max(axis=(1, 2, 3), keepdims=True) * 2 ** (8 - bits)  # of 8 bits only the lower are used
    weight = _quantized(ops.constant(np.ascontiguousarray(weight)), np.maximum(highs, 1e-9), signed=True, levels=255)
    x = _quantized(x, np.float32(high), signed, levels=256)
    strides, pads = list(conv.stride), [int(pad) for pad in conv.padding]
    x = ops.convolution(x, weight, strides, pads, pads, dilations=[1, 1])
    assert conv.bias is not None
    return ops.add(x, constant(conv.bias, 1, -1, 1, 1))


def stage_graphs(image: Any, backbone: Backbone, ranges: Sequence[float], bits: int) -> list[Any]:
    """What each stage of the backbone makes (1, C, h, w) of an image (1, 3, H, W); its fake quantizations become
    integers when it is compiled."""
    x, stages = image, []
    number = 0
    for stage, norm in zip(backbone.stages, backbone.norms, strict=True):
        assert isinstance(stage, nn.ModuleList)
        for conv in stage:
            if conv is not stage[0]:
                x = ops.relu(x)
            x = convolution(x, conv, ranges[number], signed=number == 0, bits=bits)
            number += 1
        x = ops.max_pool(x, strides=[2, 2], dilations=[1, 1], pads_begin=[0, 0], pads_end=[0, 0], kernel_shape=[2, 2])
        x = ops.relu(normalised(x.output(0), norm, 1, -1, 1, 1))
        stages.append(x)
    return stages


def backbone_graph(image: Any, backbone: Backbone, ranges: Sequence[float], bits: int) -> Any:
    """The backbone's features (1, F) of an image (1, 3, H, W)."""
    return ops.reshape(stage_graphs(image, backbone, ranges, bits)[-1], ops.constant([1, -1]), False)


class Int8Backbone:
    """A trained backbone on the CPU for images of one size (height, width). ranges: by `input_ranges`; threads: how
    many it may use; bits: of a weight, 7 for a processor that adds pairs of products in 16 bits.

    Raises ValueError where the ranges are not this backbone's, or where they or its weights are not numbers.
    """

    def __init__(
        self, backbone: Backbone, ranges: Sequence[float], size: tuple[int, int], *, threads: int, bits: int = 8
    ) -> None:
        require_trained(backbone, ranges)
        image = ops.parameter([1, 3, *size], np.float32)
        self._graph = Graph([backbone_graph(image, backbone, ranges, bits)], image, threads)

    def __call__(self, images: Tensor) -> Tensor:
        """Normalised images (N, 3, H, W), which pass one at a time, to features (N, F)."""
        return torch.from_numpy(np.concatenate([self._graph(image)[0] for image in images.numpy()[:, None]]))


def require_trained(seeing: nn.Module, ranges: Sequence[float]) -> None:
    """Raises ValueError where the ranges are not those of what sees, or where they or its weights are not numbers."""
    wanted = sum(isinstance(module, nn.Conv2d) for module in seeing.modules())
    if len(ranges) != wanted:
        raise ValueError(f"found {len(ranges)} ranges, wanted {wanted}: train the network again")
    numbers = (torch.as_tensor(ranges), *seeing.state_dict().values())
    if not all(bool(tensor.isfinite().all()) for tensor in numbers):
        raise ValueError("found weights that are not numbers, wanted a trained network: train it again")


def _check_graph(x: Any, check: CameraCheck) -> Any:
    """The outputs (1, 1 + reasons) of a camera check on a normalised image (1, 3, H, W)."""
    layers = list(check.layers)
    for conv, norm in zip(layers[0:-1:3], layers[1:-1:3], strict=True):
        assert isinstance(conv, nn.Conv2d)
        strides, pads = list(conv.stride), [int(pad) for pad in conv.padding]
        x = ops.convolution(x, constant(conv.weight), strides, pads, pads, dilations=[1, 1])
        x = ops.relu(normalised(x, norm, 1, -1, 1, 1))
    x = ops.reshape(x, ops.constant([1, -1]), False)
    return linear(ops.relu(linear(x, check.head[0])), check.head[-1])


def linear(x: Any, layer: nn.Module) -> Any:
    """A linear layer in 32 bits."""
    assert isinstance(layer, nn.Linear)
    return ops.add(ops.matmul(x, constant(layer.weight), False, True), constant(layer.bias, 1, -1))


def image_graph(size: tuple[int, int], gain: Sequence[float], shift: Sequence[float]) -> tuple[Any, Any]:
    """The parameter for an image (1, H, W, 3) in bytes, and (1, 3, H, W): each byte times the gain of its channel plus
    its shift."""
    image = ops.parameter([1, *size, 3], np.uint8)
    gains, shifts = (ops.constant(np.array(values, np.float32)) for values in (gain, shift))
    x = ops.add(ops.multiply(ops.convert(image, "f32"), gains), shifts)
    return image, ops.transpose(x, ops.constant([0, 3, 1, 2]))


class OpenVINOEyes:
    """What looks at every image when driving: a trained backbone in integers, and the camera check. bits: of a weight,
    see `Int8Backbone`. Raises ValueError as that does."""

    def __init__(
        self, network: Network, ranges: Sequence[float], check: CameraCheck | None, *, threads: int, bits: int
    ) -> None:
        require_trained(network.backbone, ranges)
        image, x = image_graph(network.config.image_size, *gain_and_shift())
        outputs = [backbone_graph(x, network.backbone, ranges, bits)]
        if check is not None:
            outputs.append(_check_graph(x, check))
        self._graph = Graph(outputs, image, threads)

    def __call__(self, image: Image) -> tuple[Floats, Floats | None]:
        """An image (H, W, 3) to features (1, F) and the check's outputs (1, 1 + reasons), None without one."""
        features, *checked = self._graph(image[None])
        return features, checked[0] if checked else None
