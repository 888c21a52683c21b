"""The task blocks through OpenVINO: the same values as torch's."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import torch
from torch import nn

from caldrive.affordances import SPECS
from caldrive.compiled import Floats
from caldrive.perception.inference.engines import blocks_engine
from caldrive.perception.inference.openvino_engine import OpenVINOBlocks
from caldrive.perception.network.config import BlockConfig
from caldrive.perception.network.network import COMMANDS, Network
from tests.perception.data import TINY

BLOCKS = [
    BlockConfig("dense", 8),
    BlockConfig("dense", 8, norm="none", length=4, dilation=3),
    BlockConfig("tconv", 8, length=5, dilation=2),
    BlockConfig("tconv", 8, norm="none", length=2),
    BlockConfig("tconv", 8, norm="layer", length=5, dilation=2),
    BlockConfig("dense", 8, norm="layer"),
]
TESTED = ("hazard_stop", "relative_angle")  # one that is conditional


def network_with(block: BlockConfig) -> Network:
    """A network whose norms have seen something, with this block for a few affordances."""
    torch.manual_seed(0)
    blocks: dict[str, Any] = {spec.name: block if spec.name in TESTED else BlockConfig("dense", 4) for spec in SPECS}
    network = Network(replace(TINY, **blocks))
    for module in network.modules():
        if isinstance(module, nn.BatchNorm1d):
            assert module.running_mean is not None
            assert module.running_var is not None
            nn.init.uniform_(module.running_mean, -1, 1)
            nn.init.uniform_(module.running_var, 0.5, 2)
        if isinstance(module, nn.BatchNorm1d | nn.LayerNorm):
            nn.init.uniform_(module.weight, 0.5, 2)
            nn.init.uniform_(module.bias, -1, 1)
    return network.eval()


def history(network: Network) -> Floats:
    features = network.backbone.n_features(network.config.image_height, network.config.image_width)
    return np.random.default_rng(1).random((network.span, features), np.float32)


@pytest.mark.parametrize("block", BLOCKS, ids=str)
@pytest.mark.parametrize("command", range(len(COMMANDS)))
def test_a_graph_gives_the_values_of_the_block(block: BlockConfig, command: int) -> None:
    network = network_with(block)
    expected = blocks_engine("fp32", network)(history(network), command)
    outputs = OpenVINOBlocks(network, threads=1)(history(network), command)
    assert list(outputs) == list(expected)
    for name, value in expected.items():
        assert outputs[name].shape == value.shape
        assert outputs[name] == pytest.approx(value, abs=1e-5), name


def test_what_a_frame_gave_stays_when_the_next_one_comes() -> None:
    network = network_with(BLOCKS[0])
    engine = OpenVINOBlocks(network, threads=1)
    first = engine(history(network), 0)["relative_angle"]
    copy = first.copy()
    assert not np.array_equal(engine(history(network) + 1, 0)["relative_angle"], copy)
    assert np.array_equal(first, copy)


def test_recurrent_blocks_pass_torch() -> None:
    network = network_with(BlockConfig("gru", 8, length=3))
    assert not isinstance(blocks_engine("int7", network, 1), OpenVINOBlocks)
    with pytest.raises(ValueError, match="found task blocks of gru, wanted dense or tconv"):
        OpenVINOBlocks(network, threads=1)


def test_only_beside_a_backbone_in_integers_they_pass_openvino() -> None:
    network = network_with(BLOCKS[2])
    assert not isinstance(blocks_engine("fp32", network, 1), OpenVINOBlocks)
    assert isinstance(blocks_engine("int8", network, 1), OpenVINOBlocks)
