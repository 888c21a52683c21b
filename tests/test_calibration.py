from __future__ import annotations

from pathlib import Path

import torch

from caldrive.perception.calibration import calibrated, uncalibrated
from caldrive.perception.dataset import Frames
from caldrive.perception.folders import find_episodes
from caldrive.perception.network import Network
from caldrive.perception.sampler import summary
from tests.perception_data import HEIGHT, TINY, WIDTH, record


def test_a_network_that_learnt_nothing_is_calibrated_to_how_often_classes_occur(tmp_path: Path) -> None:
    frames, network = Frames(find_episodes(record(tmp_path)), (HEIGHT, WIDTH)), Network(TINY)
    counts = summary(frames, frames)["train_classes"]
    for name in counts:
        torch.nn.init.zeros_(network.blocks[name].groups[0].output.weight)
        torch.nn.init.zeros_(network.blocks[name].groups[0].output.bias)
        bias = calibrated(network, counts).blocks[name].groups[0].output.bias
        share = torch.bincount(frames.targets[name], minlength=len(bias)) / len(frames)
        assert torch.allclose(bias.detach().softmax(0), share, atol=1e-3)


def test_calibration_can_be_taken_back() -> None:
    network, counts = Network(TINY), {"hazard_stop": [90, 10], "speed_sign": [0, 7, 5, 0]}
    back = uncalibrated(calibrated(network, counts), counts)
    for (name, before), after in zip(network.named_parameters(), back.parameters(), strict=True):
        torch.testing.assert_close(before, after, msg=name)
