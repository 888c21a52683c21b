"""The segmentation network at the wheel: an image to class probabilities, and to that of a junction.

The backbone drives in 8-bit integers where those are faster, through OpenVINO, the small decoder always in 32 bits.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import nn

from caldrive.agents.modular_pipeline.checkpoint import SegmentationInfo, load_segmentation
from caldrive.agents.modular_pipeline.scene import Scene
from caldrive.agents.modular_pipeline.segmentation import Refinement, SegmentationNetwork
from caldrive.compiled import Floats
from caldrive.datatypes import Image
from caldrive.interfaces import BadImage
from caldrive.perception.images import check_image, gain_and_shift, normalise, to_float
from caldrive.perception.inference.engines import INTEGERS, autocast
from caldrive.perception.inference.openvino_engine import (
    Graph,
    constant,
    image_graph,
    linear,
    normalised,
    ops,
    require_trained,
    stage_graphs,
)
from caldrive.perception.inference.precision import driving_precision

# An image (H, W, 3) in bytes to the logits of the classes (1, 5, H // 2, W // 2) and of the junction (1,).
SceneEngine = Callable[[Image], tuple[Floats, Floats]]


class NetworkSegmenter:
    """A trained network as the planner's eyes (`scene.Segmenter`). precision: see `driving_precision`; a network that
    is no file has no ranges. threads: how many it may use."""

    def __init__(self, network: SegmentationNetwork | Path, precision: str = "auto", threads: int = 1) -> None:
        if isinstance(network, SegmentationNetwork):
            info = SegmentationInfo(network.config)
        else:
            network, info = load_segmentation(network)
        self.network, precision = network.eval(), driving_precision(precision, info.ranges)
        torch.set_num_threads(1 if precision in INTEGERS else threads)
        self._look = scene_engine(network, precision, info.ranges, threads)

    def segment(self, image: Image) -> Scene:
        """What an image (H, W, 3) shows, at half its size. Raises BadImage where the image is no use."""
        check_image(image, self.network.config.image_size)
        classes, junction = self._look(image)
        if not (np.isfinite(classes).all() and np.isfinite(junction).all()):
            raise BadImage("the network's outputs are not numbers: brake, and look at the weights")
        powers = np.exp(classes[0] - classes[0].max(axis=0))
        probabilities = np.moveaxis(powers / powers.sum(axis=0), 0, -1)
        return Scene(np.ascontiguousarray(probabilities), 1 / (1 + float(np.exp(-junction[0]))))


def scene_engine(network: SegmentationNetwork, precision: str, ranges: Sequence[float], threads: int) -> SceneEngine:
    """The network in fp32, bf16, int8 or int7. ranges: of its backbone, by `calibration.input_ranges`, which integers
    need."""
    if precision in INTEGERS:
        return _integers(network, ranges, INTEGERS[precision], threads)

    @torch.inference_mode()
    def look(image: Image) -> tuple[Floats, Floats]:
        with autocast(precision, "cpu"):
            classes, junction = network(normalise(to_float(image[None])))
        return classes.float().numpy(), junction.float().numpy()

    return look


def _integers(network: SegmentationNetwork, ranges: Sequence[float], bits: int, threads: int) -> SceneEngine:
    require_trained(network.backbone, ranges)
    image, x = image_graph(network.config.image_size, *gain_and_shift())
    *finer, coarsest = stage_graphs(x, network.backbone, ranges, bits)
    known = _pointwise(coarsest, network.coarsest)
    for refinement, stage in zip(network.refinements, reversed(finer), strict=True):
        assert isinstance(refinement, Refinement)
        known = _refined(known, stage, refinement)
    features = ops.reshape(coarsest, ops.constant([1, -1]), False)
    junction = linear(ops.relu(linear(features, network.junction[0])), network.junction[2])
    graph = Graph([_pointwise(known, network.classes), junction], image, threads)

    def look(picture: Image) -> tuple[Floats, Floats]:
        classes, near = graph(picture[None])
        return classes, near[:, 0]

    return look


def _pointwise(x: Any, conv: nn.Conv2d) -> Any:
    """A convolution of 1 x 1."""
    x = ops.convolution(x, constant(conv.weight), [1, 1], [0, 0], [0, 0], [1, 1])
    assert conv.bias is not None
    return ops.add(x, constant(conv.bias, 1, -1, 1, 1))


def _refined(known: Any, stage: Any, refinement: Refinement) -> Any:
    """A step of the decoder, as `Refinement` takes it."""
    size = ops.constant(np.array(list(stage.output(0).shape)[2:], np.int64))
    larger = ops.interpolate(
        known, size, "nearest", "sizes", axes=ops.constant(np.array([2, 3])),
        coordinate_transformation_mode="asymmetric", nearest_mode="floor",
    )  # fmt: skip
    refine = refinement.refine
    x = ops.add(larger, _pointwise(stage, refinement.lateral))
    x = ops.convolution(x, constant(refine.weight), [1, 1], [1, 1], [1, 1], [1, 1])
    assert refine.bias is not None
    x = ops.add(x, constant(refine.bias, 1, -1, 1, 1))
    return ops.relu(normalised(x, refinement.norm, 1, -1, 1, 1))
