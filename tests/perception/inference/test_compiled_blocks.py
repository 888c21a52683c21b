"""The task blocks as a compiled loop: torch's values, but for the rounding of weights."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import torch
from torch import nn

from caldrive.affordances import SPECS
from caldrive.compiled import Floats
from caldrive.perception.inference.compiled_blocks import ROWS, CompiledBlocks, _add_products, _upper_halves
from caldrive.perception.inference.engines import blocks_engine
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
ROUNDING = 3e-3  # of outputs of about 1, by weights of 8 bits
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
def test_a_compiled_block_gives_the_values_of_the_block(block: BlockConfig, command: int) -> None:
    network = network_with(block)
    expected = blocks_engine("fp32", network)(history(network), command)
    outputs = CompiledBlocks(network)(history(network), command)
    assert list(outputs) == list(expected)
    for name, value in expected.items():
        assert outputs[name].shape == value.shape
        assert outputs[name] == pytest.approx(value, abs=ROUNDING), name


def test_what_a_frame_gave_stays_when_the_next_one_comes() -> None:
    network = network_with(BLOCKS[0])
    engine = CompiledBlocks(network)
    first = engine(history(network), 0)["relative_angle"]
    copy = first.copy()
    assert not np.array_equal(engine(history(network) + 1, 0)["relative_angle"], copy)
    assert np.array_equal(first, copy)


def test_recurrent_blocks_pass_torch() -> None:
    network = network_with(BlockConfig("gru", 8, length=3))
    assert not isinstance(blocks_engine("int7", network), CompiledBlocks)
    with pytest.raises(ValueError, match="found task blocks of gru, wanted dense or tconv"):
        CompiledBlocks(network)


@pytest.mark.parametrize("conditioning", ["input", "all"])
def test_blocks_without_groups_for_the_commands_pass_torch(conditioning: Any) -> None:
    network = network_with(BlockConfig("dense", 8, conditioning=conditioning))
    engine = blocks_engine("int7", network)
    angles = [engine(history(network), command)["relative_angle"].item() for command in range(len(COMMANDS))]
    assert len(set(angles)) == len(COMMANDS)
    with pytest.raises(ValueError, match="found task blocks without groups for the commands"):
        CompiledBlocks(network)


def test_only_beside_a_backbone_in_integers_they_are_compiled() -> None:
    network = network_with(BLOCKS[2])
    assert not isinstance(blocks_engine("fp32", network), CompiledBlocks)
    assert isinstance(blocks_engine("int8", network), CompiledBlocks)


def test_weights_are_rounded_to_the_nearest_bfloat16() -> None:
    values = np.random.default_rng(0).normal(size=10_000).astype(np.float32)
    values[:3] = 0.0, np.float32(1 + 2**-8), np.float32(1 + 3 * 2**-8)  # two ties
    wanted = torch.from_numpy(values).bfloat16().float().numpy()
    assert np.array_equal((_upper_halves(values).astype(np.uint32) << 16).view(np.float32), wanted)


@pytest.mark.parametrize("features", [1, 2, 3, 4, 5, 7])
def test_any_number_of_features_is_added_up(features: int) -> None:
    rng = np.random.default_rng(0)
    x, weights, hidden = (
        rng.random(features, np.float32),
        rng.random((features, 8), np.float32),
        np.zeros(8, np.float32),
    )
    padded = np.pad(_upper_halves(weights), ((0, -features % ROWS), (0, 0)))
    _add_products(x, padded, hidden)
    assert hidden == pytest.approx(x @ weights, rel=0.01)
