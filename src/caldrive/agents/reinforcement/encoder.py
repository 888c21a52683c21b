"""A frozen encoder: the backbone of a network that learnt something else, such as segmentation, at the wheel."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch

from caldrive.agents.reinforcement.inputs import Encode
from caldrive.compiled import Floats
from caldrive.datatypes import Image
from caldrive.files import as_type
from caldrive.perception.images import normalise, to_float
from caldrive.perception.inference.engines import INTEGERS
from caldrive.perception.inference.precision import driving_precision
from caldrive.perception.network.backbone import Backbone
from caldrive.perception.network.checkpoint import (
    CheckpointError,
    read_header,
    read_tensors,
    require_kind,
    single_precision,
)

BACKBONE = "backbone."  # what the names of its tensors begin with


@dataclass(frozen=True)
class Encoder:
    """A backbone, the images (H, W) that it takes, and the ranges of what enters its convolutions, which integers need
    (`calibration.input_ranges`; empty where nobody looked)."""

    backbone: Backbone
    image_size: tuple[int, int]
    ranges: tuple[float, ...] = ()

    @property
    def n_features(self) -> int:
        """Numbers that it makes of an image."""
        return self.backbone.n_features(*self.image_size)


def load_encoder(path: Path) -> Encoder:
    """The backbone of the modular pipeline's network, which learnt segmentation alone. Raises CheckpointError where the
    file is none."""
    header = read_header(path)
    require_kind(path, header, "mp")
    tensors = single_precision(read_tensors(path)[0], camera_check=False)
    state = {name.removeprefix(BACKBONE): value for name, value in tensors.items() if name.startswith(BACKBONE)}
    try:
        config = as_type(header["config"], dict[str, Any])
        backbone = Backbone(config["width"], batch_norm=True)
        backbone.load_state_dict(state)
        size = int(config["image_height"]), int(config["image_width"])
        return Encoder(backbone, size, as_type(header["ranges"], tuple[float, ...]))
    except (KeyError, TypeError, ValueError, RuntimeError) as error:
        raise CheckpointError(
            f"found in {path} no backbone that can be read ({error}), wanted one: train the network again"
        ) from error


def encode_function(encoder: Encoder, threads: int = 1) -> Encode:
    """What makes features (F,) of an image (H, W, 3) in bytes, in this processor's fastest precision."""
    precision = driving_precision("auto", encoder.ranges)
    backbone = encoder.backbone.eval()
    if precision in INTEGERS:
        from caldrive.perception.inference.openvino_engine import Int8Backbone  # OpenVINO, which only integers need

        torch.set_num_threads(1)  # torch's own would wait for one another beside OpenVINO's
        integers = Int8Backbone(backbone, encoder.ranges, encoder.image_size, threads=threads, bits=INTEGERS[precision])
        return lambda image: integers(_prepared(image)).numpy()[0]
    dtype = torch.bfloat16 if precision == "bf16" else torch.float32
    backbone.to(dtype)

    @torch.inference_mode()
    def encode(image: Image) -> Floats:
        features: Floats = backbone(_prepared(image).to(dtype)).float().numpy()[0]
        return features

    return encode


def _prepared(image: Image) -> torch.Tensor:
    return normalise(to_float(image[None]))
