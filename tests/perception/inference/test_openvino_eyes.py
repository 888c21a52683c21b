"""What looks at every image when driving through OpenVINO: the same as backbone and camera check one by one."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from caldrive.perception.images import normalise, to_float
from caldrive.perception.inference.engines import eyes_engine
from caldrive.perception.inference.openvino_engine import Int8Backbone, OpenVINOEyes
from caldrive.perception.network.calibration import input_ranges
from caldrive.perception.network.camera_check import REASONS, CameraCheck
from caldrive.perception.network.network import Network
from tests.perception.data import HEIGHT, TINY, WIDTH

IMAGE = np.random.default_rng(0).integers(0, 256, (HEIGHT, WIDTH, 3), np.uint8)


@pytest.fixture
def network() -> Network:
    torch.manual_seed(0)
    return Network(TINY).eval()


@pytest.fixture
def check() -> CameraCheck:
    torch.manual_seed(1)
    check = CameraCheck((HEIGHT, WIDTH)).train()
    check(torch.randn(16, 3, HEIGHT, WIDTH))  # statistics for the norms
    return check.eval()


@torch.inference_mode()
def test_eyes_see_what_backbone_and_camera_check_see(network: Network, check: CameraCheck) -> None:
    images = normalise(to_float(IMAGE[None]))
    ranges = input_ranges(network.backbone, images)
    features, outputs = OpenVINOEyes(network, ranges, check, threads=1, bits=8)(IMAGE)
    wanted = Int8Backbone(network.backbone, ranges, (HEIGHT, WIDTH), threads=1)(images).numpy()
    assert features.shape == wanted.shape
    differences = np.linalg.norm(features - wanted)
    assert differences < 0.02 * np.linalg.norm(wanted)  # a byte where rounding decides
    assert outputs is not None
    assert outputs.shape == (1, 1 + len(REASONS))
    assert outputs == pytest.approx(check(images).numpy(), abs=1e-4)


@torch.inference_mode()
@pytest.mark.parametrize("precision", ["fp32", "int8"])
def test_without_a_camera_check_there_are_features_only(network: Network, precision: str) -> None:
    ranges = input_ranges(network.backbone, normalise(to_float(IMAGE[None])))
    features, outputs = eyes_engine(precision, network, ranges, None, threads=1)(IMAGE)
    assert features.shape == (1, network.backbone.n_features(HEIGHT, WIDTH))
    assert outputs is None
