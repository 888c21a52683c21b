"""The segmentation network at the wheel."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from caldrive.agents.modular_pipeline.config import SegmentationConfig
from caldrive.agents.modular_pipeline.segmentation import SegmentationNetwork
from caldrive.agents.modular_pipeline.segmenter import NetworkSegmenter, scene_engine
from caldrive.interfaces import BadImage
from caldrive.perception.images import normalise, to_float
from caldrive.perception.network.calibration import input_ranges
from tests.perception.data import HEIGHT, WIDTH

SMALL = SegmentationConfig(image_width=WIDTH, image_height=HEIGHT, width=1 / 8, decoder=8, junction_nodes=8)


@pytest.fixture
def network() -> SegmentationNetwork:
    """One whose batch norms have seen something."""
    torch.manual_seed(0)
    network = SegmentationNetwork(SMALL)
    with torch.no_grad():
        for _ in range(20):
            network(torch.randn(8, 3, HEIGHT, WIDTH))
    return network.eval()


def noise(seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).integers(0, 255, (HEIGHT, WIDTH, 3), dtype=np.uint8)


def test_a_scene_is_made_of_probabilities_at_half_the_size(network: SegmentationNetwork) -> None:
    scene = NetworkSegmenter(network).segment(noise())
    assert scene.classes.shape == (HEIGHT // 2, WIDTH // 2, 5)
    assert scene.classes.sum(-1) == pytest.approx(1.0, abs=1e-5)
    assert 0 < scene.junction < 1
    again = NetworkSegmenter(network).segment(noise())
    assert (again.classes == scene.classes).all()
    assert again.junction == scene.junction


def test_integers_see_nearly_the_same(network: SegmentationNetwork) -> None:
    images = normalise(to_float(np.stack([noise(k) for k in range(8)])))
    ranges = input_ranges(network.backbone, images)
    exact, integers = (
        scene_engine(network, name, ranges, 1) for name in ("fp32", "int7")
    )  # int8 is exact on some processors only
    for k in range(4):
        wanted, found = exact(noise(k)), integers(noise(k))
        spread = wanted[0].std()
        assert np.abs(found[0] - wanted[0]).mean() < 0.15 * spread
        assert found[1] == pytest.approx(wanted[1], abs=0.15 * (1 + abs(float(wanted[1][0]))))


def test_ranges_of_another_network_are_refused(network: SegmentationNetwork) -> None:
    with pytest.raises(ValueError, match="found 2 ranges, wanted 13"):
        scene_engine(network, "int8", (1.0, 1.0), 1)


def test_an_image_that_is_no_use_is_refused(network: SegmentationNetwork) -> None:
    segmenter = NetworkSegmenter(network)
    with pytest.raises(BadImage, match="the image is black"):
        segmenter.segment(np.zeros((HEIGHT, WIDTH, 3), np.uint8))
    with pytest.raises(BadImage, match=r"the image is \(88, 200, 3\)"):
        segmenter.segment(np.full((88, 200, 3), 99, np.uint8))
    with torch.no_grad():
        network.classes.weight.fill_(torch.nan)
    with pytest.raises(BadImage, match="outputs are not numbers"):
        segmenter.segment(noise())
