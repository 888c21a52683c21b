"""A frozen encoder: the backbone of a network that learnt something else, such as segmentation, at the wheel."""

from __future__ import annotations

from copy import deepcopy
from dataclasses import dataclass
from pathlib import Path

import torch

from caldrive.agents.modular_pipeline.checkpoint import load_segmentation
from caldrive.agents.reinforcement.inputs import Encode
from caldrive.compiled import Floats
from caldrive.datatypes import Image
from caldrive.perception.images import normalise, to_float
from caldrive.perception.inference.engines import INTEGERS, backbone_engine
from caldrive.perception.inference.precision import driving_precision
from caldrive.perception.network.backbone import Backbone


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
    """The backbone of the modular pipeline's network, which learnt to segment, and to tell junctions.
    Raises CheckpointError where the
    file is none."""
    network, info = load_segmentation(path)
    return Encoder(network.backbone, info.config.image_size, info.ranges)


def encode_function(encoder: Encoder, threads: int = 1) -> Encode:
    """What makes features (F,) of an image (H, W, 3) in bytes, in this processor's fastest precision."""
    precision = driving_precision("auto", encoder.ranges)
    # Beside OpenVINO's threads torch's own would wait for one another.
    torch.set_num_threads(1 if precision in INTEGERS else threads)
    backbone = deepcopy(encoder.backbone).eval()  # bf16 turns it, and the encoder is saved with the policy
    engine = backbone_engine(precision, backbone, encoder.image_size, encoder.ranges, threads)

    @torch.inference_mode()
    def encode(image: Image) -> Floats:
        features: Floats = engine(normalise(to_float(image[None]))).numpy()[0]
        return features

    return encode
