from __future__ import annotations

from pathlib import Path

import torch

from caldrive.perception.calibration import calibrated
from caldrive.perception.dataset import Frames
from caldrive.perception.folders import find_episodes
from caldrive.perception.network import Network
from caldrive.perception.sampler import Sampler
from caldrive.perception.specs import class_weights
from tests.perception_data import HEIGHT, TINY, WIDTH, record


def test_a_network_that_learnt_nothing_is_calibrated_to_how_often_classes_occur(tmp_path: Path) -> None:
    frames, network = Frames(find_episodes(record(tmp_path)), (HEIGHT, WIDTH)), Network(TINY)
    drawn = Sampler(frames, 3, 0.7, seed=0).class_counts()
    weights = class_weights(drawn)
    for name in weights:
        torch.nn.init.zeros_(network.blocks[name].groups[0].output.weight)
        torch.nn.init.zeros_(network.blocks[name].groups[0].output.bias)
        bias = calibrated(network, frames, drawn, weights).blocks[name].groups[0].output.bias
        share = torch.bincount(frames.targets[name], minlength=len(bias)) / len(frames)
        assert torch.allclose(bias.detach().softmax(0), share, atol=1e-3)
