"""What runs a network's backbone and its task blocks in each precision."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from typing import Any

import torch
from torch import Tensor

from caldrive.compiled import Floats
from caldrive.datatypes import Image
from caldrive.perception.images import normalise, to_float
from caldrive.perception.inference.compiled_blocks import CompiledBlocks, passes
from caldrive.perception.network.backbone import Backbone
from caldrive.perception.network.camera_check import CameraCheck
from caldrive.perception.network.network import Network

BackboneEngine = Callable[[Tensor], Tensor]  # normalised images (N, 3, H, W) to features (N, F)
# An image (H, W, 3) in bytes to features (1, F), and the camera check's outputs (1, 1 + reasons).
EyesEngine = Callable[[Image], tuple[Floats, Floats | None]]
# Features (span, F) and a command's number to outputs (1, K) by affordance.
BlocksEngine = Callable[[Floats, int], Mapping[str, Floats]]

INTEGERS = {"int8": 8, "int7": 7}  # bits of a weight
PRECISIONS = ("auto", "fp32", "bf16", *INTEGERS)


def _bf16_is_faster() -> bool:
    """Whether this processor multiplies bfloat16 faster than fp32: with AMX, or AVX512-BF16 on an AMD; Intel's cores
    without AMX take 1.7 times as long (one frame through the small network: 9.8 ms, in fp32 5.8 ms)."""
    features = torch.cpu.get_capabilities()
    amd = "Intel" not in features.get("cpu_name", "")
    return bool(features.get("amx_bf16") or (features.get("avx512_bf16") and amd))


def use_bf16(precision: str, device: str) -> bool:
    """Whether to compute in bfloat16; `auto` does where that is faster than fp32."""
    if precision not in ("auto", "fp32", "bf16"):
        raise ValueError(f"found precision {precision!r}, wanted auto, fp32 or bf16: type --precision auto")
    if precision != "auto":
        return precision == "bf16"
    return device != "cpu" or _bf16_is_faster()


def autocast(precision: str, device: str) -> AbstractContextManager[Any]:
    """The context in which the network computes."""
    return torch.autocast(device.split(":")[0], torch.bfloat16) if use_bf16(precision, device) else nullcontext()


def backbone_engine(
    precision: str, backbone: Backbone, size: tuple[int, int], ranges: Sequence[float], threads: int | None = None
) -> BackboneEngine:
    """A backbone in fp32, bf16, int8 or int7 on the CPU, for images of a size (height, width); bf16 turns the backbone
    itself. ranges: by `calibration.input_ranges`, which integers need. threads: for integers, as many as torch has
    without it."""
    if precision in INTEGERS:
        from caldrive.perception.inference.openvino_engine import Int8Backbone  # OpenVINO, which only integers need

        threads = threads or torch.get_num_threads()
        return Int8Backbone(backbone, ranges, size, threads=threads, bits=INTEGERS[precision])
    dtype = torch.bfloat16 if precision == "bf16" else torch.float32
    backbone.to(dtype)
    return lambda images: backbone(images.to(dtype)).float()


def eyes_engine(
    precision: str, network: Network, ranges: Sequence[float], check: CameraCheck | None, threads: int | None = None
) -> EyesEngine:
    """Backbone and camera check when driving: beside a backbone in integers the check, too, passes OpenVINO."""
    if precision in INTEGERS:
        from caldrive.perception.inference.openvino_engine import OpenVINOEyes

        return OpenVINOEyes(
            network, ranges, check, threads=threads or torch.get_num_threads(), bits=INTEGERS[precision]
        )
    backbone = backbone_engine(precision, network.backbone, network.config.image_size, ranges, threads)

    @torch.inference_mode()
    def look(image: Image) -> tuple[Floats, Floats | None]:
        images = normalise(to_float(image[None]))
        return backbone(images).numpy(), None if check is None else check(images).numpy()

    return look


def blocks_engine(precision: str, network: Network) -> BlocksEngine:
    """The task blocks when driving: beside a backbone in integers as one compiled loop, where they pass there."""
    if precision in INTEGERS and all(map(passes, network.task_blocks().values())):
        return CompiledBlocks(network)

    @torch.inference_mode()
    def decide(history: Floats, command: int) -> Mapping[str, Floats]:
        outputs = network(torch.from_numpy(history)[None], torch.tensor([command]))
        return {name: output.numpy() for name, output in outputs.items()}

    return decide
