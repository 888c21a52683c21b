from __future__ import annotations

from pathlib import Path
from typing import Any

import torch

from caldrive.perception.dataset.frames import Frames
from caldrive.perception.dataset.sampler import data_summary
from caldrive.perception.network.calibration import calibrated, uncalibrated
from caldrive.perception.network.network import Network
from caldrive.recordings.folder import find_episodes
from tests.perception.data import HEIGHT, TINY, WIDTH, record


def output_layer(network: Network, name: str) -> Any:
    """The last layer of an affordance's task block."""
    block: Any = network.blocks[name]
    return block.groups[0].output


def test_a_network_that_learnt_nothing_is_calibrated_to_how_often_classes_occur(tmp_path: Path) -> None:
    frames, network = Frames(find_episodes(record(tmp_path)), (HEIGHT, WIDTH)), Network(TINY)
    counts = data_summary(frames, frames)["train_classes"]
    for name in counts:
        torch.nn.init.zeros_(output_layer(network, name).weight)
        torch.nn.init.zeros_(output_layer(network, name).bias)
        bias = output_layer(calibrated(network, counts), name).bias
        share = torch.bincount(frames.targets[name], minlength=len(bias)) / len(frames)
        assert torch.allclose(bias.detach().softmax(0), share, atol=1e-3)


def test_calibration_can_be_taken_back() -> None:
    network, counts = Network(TINY), {"hazard_stop": [90, 10], "speed_sign": [0, 7, 5, 0]}
    back = uncalibrated(calibrated(network, counts), counts)
    for (name, before), after in zip(network.named_parameters(), back.parameters(), strict=True):
        torch.testing.assert_close(before, after, msg=name)
