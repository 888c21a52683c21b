"""OpenVINO, which computes a finished network at the wheel: how a graph is compiled, and what graphs have in common."""

from __future__ import annotations

import sys
from typing import Any

import numpy as np
from numpy.typing import NDArray
from torch import Tensor, nn

# OpenVINO's converter, which nobody needs here, tells its makers over the network when it is imported; without it the
# rest works.
sys.modules.setdefault("openvino.tools.ovc", None)  # type: ignore[arg-type]
import openvino as ov  # noqa: E402
from openvino import opset13  # noqa: E402

ops: Any = opset13


def compiled(outputs: list[Any], parameter: Any, threads: int) -> ov.InferRequest:
    """A request that computes the outputs, each frame as soon as it comes."""
    settings = {
        "INFERENCE_NUM_THREADS": threads, "INFERENCE_PRECISION_HINT": "f32", "PERFORMANCE_HINT": "LATENCY",
        "ENABLE_CPU_PINNING": False,
    }  # fmt: skip
    return ov.Core().compile_model(ov.Model(outputs, [parameter]), "CPU", settings).create_infer_request()


def constant(values: Tensor, *shape: int) -> Any:
    """Trained values in 32 bits, in another shape where one is given."""
    found: NDArray[np.float32] = values.detach().float().numpy()
    return ops.constant(np.ascontiguousarray(found.reshape(shape) if shape else found))


def normalised(x: Any, norm: nn.Module, *shape: int) -> Any:
    """Batch norm by its running statistics, or layer norm over the last axis, with gain and shift of this shape;
    anything else leaves x as it is."""
    if isinstance(norm, nn.LayerNorm):
        x = ops.mvn(x, ops.constant(np.array([-1])), True, norm.eps, "inside_sqrt")
        return ops.add(ops.multiply(x, constant(norm.weight, *shape)), constant(norm.bias, *shape))
    if not isinstance(norm, nn.BatchNorm1d | nn.BatchNorm2d):
        return x
    assert norm.running_var is not None
    assert norm.running_mean is not None
    gain = norm.weight / (norm.running_var + norm.eps).sqrt()
    shift = norm.bias - norm.running_mean * gain
    return ops.add(ops.multiply(x, constant(gain, *shape)), constant(shift, *shape))
