from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from torch import Tensor

from caldrive.perception.calibration import input_ranges
from caldrive.perception.checkpoint import CheckpointInfo, load_network, save_network
from caldrive.perception.images import normalise, to_float
from caldrive.perception.int8 import Int8Backbone
from caldrive.perception.network import Network
from caldrive.perception.precision import resolve
from caldrive.perception.predictor import NetworkPerception
from tests.perception_data import HEIGHT, TINY, WIDTH, column_image
from tests.test_predictor import see, values


def columns() -> Tensor:
    """Normalised images (9, 3, H, W)."""
    return normalise(to_float(np.stack([column_image(place / 4) for place in range(-4, 5)])))


@pytest.fixture(params=(True, False), ids=("batch norm", "no norm"))
def network(request: pytest.FixtureRequest) -> Network:
    torch.manual_seed(0)
    made = Network(replace(TINY, batch_norm=request.param, width=0.25))
    made.train()(made.features(columns())[:, None], torch.zeros(9, dtype=torch.long))  # statistics for the norms
    return made.eval()


def test_eight_bits_give_nearly_the_features_of_thirty_two(network: Network) -> None:
    ranges = input_ranges(network.backbone, columns())
    backbone = Int8Backbone(network.backbone, ranges, HEIGHT, WIDTH, threads=1)
    for image in columns().split(1):
        with torch.no_grad():
            exact, rounded = network.features(image), backbone(image)
        assert rounded.shape == exact.shape
        error = float((rounded - exact).norm() / exact.norm())
        assert 0 < error < 0.1


def test_a_range_is_the_size_of_what_enters_a_convolution(network: Network) -> None:
    ranges = input_ranges(network.backbone, columns())
    assert len(ranges) == 13
    assert ranges[0] == pytest.approx(float(columns().abs().max()), rel=1e-3)
    with torch.no_grad():
        entering = network.backbone.maps(columns())[0]
    assert ranges[2] == pytest.approx(float(entering.max()), rel=0.1)


def test_ranges_of_another_backbone_are_refused(network: Network) -> None:
    with pytest.raises(ValueError, match="found 3 ranges, wanted 13"):
        Int8Backbone(network.backbone, (1.0, 1.0, 1.0), HEIGHT, WIDTH, threads=1)


def test_a_network_with_ranges_drives_in_eight_bits(network: Network, tmp_path: Path) -> None:
    path, ranges = tmp_path / "model.safetensors", input_ranges(network.backbone, columns())
    save_network(path, network, CheckpointInfo(network.config, ranges=ranges))
    assert load_network(path)[1].ranges == pytest.approx(ranges)
    rounded = values(NetworkPerception(path).predict(see(column_image(0.2))))
    exact = values(NetworkPerception(path, "fp32").predict(see(column_image(0.2))))
    assert rounded != exact
    assert rounded[0] == pytest.approx(exact[0], abs=0.1)
    assert rounded[4:] == pytest.approx(exact[4:], abs=0.3)


def test_eight_bits_need_ranges() -> None:
    without, known = CheckpointInfo(TINY), CheckpointInfo(TINY, ranges=(1.0,) * 13)
    assert resolve("auto", known) == "int8"
    assert resolve("fp32", known) == "fp32"
    assert resolve("auto", without) in ("fp32", "bf16")
    with pytest.raises(ValueError, match="ranges"):
        resolve("int8", without)
