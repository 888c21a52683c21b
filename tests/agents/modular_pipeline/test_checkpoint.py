"""The file of a segmentation network."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
import torch

from caldrive.agents.modular_pipeline.checkpoint import (
    SegmentationInfo,
    load_segmentation,
    read_segmentation_info,
    save_segmentation,
)
from caldrive.agents.modular_pipeline.segmentation import SegmentationNetwork
from caldrive.agents.rows import SHIPPED_MODEL
from caldrive.perception.network.checkpoint import load_network
from caldrive.perception.network.tensor_file import CheckpointError, round_to_half
from tests.agents.modular_pipeline.test_segmenter import SMALL

INFO = SegmentationInfo(SMALL, {"train_frames": 3}, {"iou/road": 0.5}, {"steps": 7}, (1.0,) * 13)


@pytest.fixture
def network() -> SegmentationNetwork:
    torch.manual_seed(0)
    return SegmentationNetwork(SMALL).eval()


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "model.safetensors"


def test_a_network_comes_back_as_it_was_measured(network: SegmentationNetwork, path: Path) -> None:
    round_to_half(network)
    save_segmentation(path, network, INFO)
    loaded, info = load_segmentation(path)
    assert info == INFO == read_segmentation_info(path)
    for name, value in network.state_dict().items():
        assert (loaded.state_dict()[name] == value).all()


def test_weights_of_other_agents_are_refused(network: SegmentationNetwork, path: Path) -> None:
    with pytest.raises(CheckpointError, match=r"found in .* weights of the agent cal, wanted those of mp"):
        read_segmentation_info(SHIPPED_MODEL)
    save_segmentation(path, network, INFO)
    with pytest.raises(CheckpointError, match=r"found in .* weights of the agent mp, wanted those of cal"):
        load_network(path)


def test_weights_that_do_not_fit_their_settings_are_refused(network: SegmentationNetwork, path: Path) -> None:
    save_segmentation(path, network, replace(INFO, config=replace(SMALL, decoder=9)))
    with pytest.raises(CheckpointError, match="weights that do not fit its own settings"):
        load_segmentation(path)
    save_segmentation(path, network, replace(INFO, config=replace(SMALL, width=9.0)))  # more than there is memory for
    with pytest.raises(CheckpointError, match="weights that do not fit its own settings"):
        load_segmentation(path)


def test_weights_that_are_not_numbers_are_refused(network: SegmentationNetwork, path: Path) -> None:
    with torch.no_grad():
        network.classes.weight[0, 0] = torch.nan
    save_segmentation(path, network, INFO)
    with pytest.raises(CheckpointError, match="weights that are not numbers"):
        load_segmentation(path)


def test_a_file_that_is_not_there_or_damaged_ends_in_a_sentence(network: SegmentationNetwork, path: Path) -> None:
    with pytest.raises(CheckpointError, match="found no file"):
        load_segmentation(path)
    save_segmentation(path, network, INFO)
    path.write_bytes(path.read_bytes()[:-100])
    with pytest.raises(CheckpointError, match="damaged"):
        load_segmentation(path)
