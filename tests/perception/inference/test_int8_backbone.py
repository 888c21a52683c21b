from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from torch import Tensor

from caldrive.perception.images import normalise, to_float
from caldrive.perception.inference.openvino_engine import Int8Backbone
from caldrive.perception.inference.predictor import NetworkPerception
from caldrive.perception.network.calibration import input_ranges
from caldrive.perception.network.checkpoint import CheckpointInfo, load_network, save_network
from caldrive.perception.network.network import Network
from tests.perception.data import HEIGHT, TINY, WIDTH, column_image, see, values


def columns() -> Tensor:
    """Normalised images (9, 3, H, W)."""
    return normalise(to_float(np.stack([column_image(place / 4) for place in range(-4, 5)])))


def network_of(batch_norm: bool, height: int = HEIGHT, width: int = WIDTH) -> Network:
    torch.manual_seed(0)
    network = Network(replace(TINY, batch_norm=batch_norm, width=0.25, image_height=height, image_width=width))
    network.train().features(torch.randn(9, 3, height, width))  # statistics for the norms
    return network.eval()


@pytest.fixture(params=(True, False), ids=("batch norm", "no norm"))
def network(request: pytest.FixtureRequest) -> Network:
    return network_of(request.param)


@pytest.mark.parametrize("bits", [7, 8])
@pytest.mark.parametrize("batch_norm", [True, False])
@pytest.mark.parametrize("size", [(HEIGHT, WIDTH), (44, 100)], ids=("even", "cut off by pools"))
def test_eight_bits_give_nearly_the_features_of_thirty_two(size: tuple[int, int], batch_norm: bool, bits: int) -> None:
    network, images = network_of(batch_norm, *size), torch.randn(4, 3, *size)
    ranges = input_ranges(network.backbone, images)
    backbone = Int8Backbone(network.backbone, ranges, size, threads=1, bits=bits)
    with torch.no_grad():
        exact, rounded = network.features(images), backbone(images)
    assert rounded.shape == exact.shape
    error = (rounded - exact).norm(dim=1) / exact.norm(dim=1)
    assert float(error.min()) > 0
    assert float(error.max()) < 0.1
    assert torch.equal(rounded[2:3], backbone(images[2:3]))


def test_a_range_is_the_size_of_what_enters_a_convolution(network: Network) -> None:
    ranges = input_ranges(network.backbone, columns())
    assert len(ranges) == 13
    assert ranges[0] == pytest.approx(float(columns().abs().max()))
    with torch.no_grad():
        entering = network.backbone.maps(columns())[0]
    assert ranges[2] == pytest.approx(float(entering.max()))


def test_a_range_holds_the_one_bright_pixel_of_many_images(network: Network) -> None:
    images = columns().repeat(4, 1, 1, 1)
    images[20, 0, 0, 0] = 1000.0
    assert input_ranges(network.backbone, images)[0] == 1000.0


def test_integers_do_not_hide_weights_that_are_not_numbers(network: Network) -> None:
    ranges = input_ranges(network.backbone, columns())
    network.backbone.convolutions()[3].weight.data[0, 0, 0, 0] = float("nan")
    with pytest.raises(ValueError, match="not numbers"):
        Int8Backbone(network.backbone, ranges, (HEIGHT, WIDTH), threads=1)


def test_openvino_tells_its_makers_nothing() -> None:
    module = "caldrive.perception.inference.openvino_engine"
    code = f"import sys, {module}; print([n for n in sys.modules if 'telemetry' in n])"
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert result.stdout.strip() == "[]"


def test_ranges_of_another_backbone_are_refused(network: Network) -> None:
    with pytest.raises(ValueError, match="found 3 ranges, wanted 13"):
        Int8Backbone(network.backbone, (1.0, 1.0, 1.0), (HEIGHT, WIDTH), threads=1)


def test_a_network_with_ranges_drives_in_integers(network: Network, tmp_path: Path) -> None:
    path, ranges = tmp_path / "model.safetensors", input_ranges(network.backbone, columns())
    save_network(path, network, CheckpointInfo(network.config, ranges=ranges))
    assert load_network(path)[1].ranges == pytest.approx(ranges)
    rounded = values(NetworkPerception(path, "int7").predict(see(column_image(0.2))))
    exact = values(NetworkPerception(path, "fp32").predict(see(column_image(0.2))))
    assert rounded != exact
    assert rounded[0] == pytest.approx(exact[0], abs=0.02)
    assert rounded[4:] == pytest.approx(exact[4:], abs=0.02)


def test_weights_of_seven_bits_do_not_overflow_sixteen(network: Network) -> None:
    """Bright images and weights of one sign: in 8 bits a processor without VNNI would cut the sums off."""
    for conv in network.backbone.convolutions():
        conv.weight.data.abs_()
    images = columns().abs()
    ranges = input_ranges(network.backbone, images)
    backbone = Int8Backbone(network.backbone, ranges, (HEIGHT, WIDTH), threads=1, bits=7)
    with torch.no_grad():
        exact, rounded = network.features(images), backbone(images)
    assert float((rounded - exact).norm() / exact.norm()) < 0.05
