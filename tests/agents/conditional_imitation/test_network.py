"""The imitation network and its file."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
import torch

from caldrive.agents.conditional_imitation.checkpoint import (
    ImitationInfo,
    load_imitation,
    read_imitation_info,
    round_to_bytes,
    save_imitation,
)
from caldrive.agents.conditional_imitation.config import IMITATION_NETWORKS, ImitationConfig, ImitationNetworkConfig
from caldrive.agents.conditional_imitation.network import ImitationNetwork
from caldrive.agents.rows import SHIPPED_MODEL
from caldrive.perception.dataset.config import RecolourConfig
from caldrive.perception.network.tensor_file import CheckpointError
from tests.agents.conditional_imitation.data import SMALL

INFO = ImitationInfo(SMALL, {"train_frames": 3}, {"loss": 0.5}, {"steps": 1})


@pytest.fixture
def network() -> ImitationNetwork:
    torch.manual_seed(0)
    return ImitationNetwork(SMALL).eval()


def inputs(n: int, size: tuple[int, int]) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
    return torch.rand(n, 3, *size), torch.rand(n) * 10, torch.arange(n) % 3


@pytest.mark.parametrize(("name", "millions"), [("published", 6.8), ("cal-backbone", 3.1)])
def test_the_networks_have_as_many_weights_as_their_tables_say(name: str, millions: float) -> None:
    network = ImitationNetwork(IMITATION_NETWORKS[name]).eval()
    assert sum(value.numel() for value in network.parameters()) == pytest.approx(millions * 1e6, rel=0.02)
    with torch.inference_mode():
        controls, speed = network(*inputs(2, network.config.image_size))
    assert (controls.shape, speed.shape) == ((2, 3), (2,))


def test_a_command_takes_its_own_branch_and_teaches_no_other(network: ImitationNetwork) -> None:
    images, speed, _ = inputs(4, SMALL.image_size)
    network(images, speed, torch.ones(4).long())[0].sum().backward()
    taught = [any(p.grad is not None and p.grad.any() for p in branch.parameters()) for branch in network.branches]
    assert taught == [False, True, False]


def test_the_speed_is_guessed_from_the_image_alone(network: ImitationNetwork) -> None:
    images, speed, command = inputs(3, SMALL.image_size)
    with torch.inference_mode():
        slow, fast = network(images, speed, command), network(images, speed + 5, command)
    assert torch.equal(slow[1], fast[1])
    assert not torch.equal(slow[0], fast[0])


def test_a_network_comes_back_as_it_was_measured(network: ImitationNetwork, tmp_path: Path) -> None:
    round_to_bytes(network)
    save_imitation(tmp_path / "model.safetensors", network, INFO)
    loaded, info = load_imitation(tmp_path / "model.safetensors")
    assert info == INFO
    for name, value in network.state_dict().items():
        torch.testing.assert_close(loaded.state_dict()[name], value, rtol=1e-6, atol=1e-9)


def test_bytes_hardly_change_what_a_network_says(network: ImitationNetwork, tmp_path: Path) -> None:
    save_imitation(tmp_path / "model.safetensors", network, INFO)
    images, speed, command = inputs(8, SMALL.image_size)
    with torch.inference_mode():
        whole, bytes_ = (
            one(images, speed, command)[0] for one in (network, load_imitation(tmp_path / "model.safetensors")[0])
        )
    assert (whole - bytes_).abs().max() < 0.02 * (1 + whole.abs().max())


def test_the_published_network_is_small_enough_to_ship(tmp_path: Path) -> None:
    config = ImitationNetworkConfig()
    save_imitation(tmp_path / "model.safetensors", ImitationNetwork(config), ImitationInfo(config))
    assert (tmp_path / "model.safetensors").stat().st_size < 10e6


def test_weights_of_another_agent_are_refused() -> None:
    with pytest.raises(CheckpointError, match=r"found in .* weights of the agent cal, wanted those of cil"):
        read_imitation_info(SHIPPED_MODEL)


def test_weights_that_do_not_fit_their_settings_are_refused(network: ImitationNetwork, tmp_path: Path) -> None:
    save_imitation(tmp_path / "model.safetensors", network, replace(INFO, config=replace(SMALL, nodes=17)))
    with pytest.raises(CheckpointError, match="weights that do not fit its own settings"):
        load_imitation(tmp_path / "model.safetensors")


def test_weights_that_are_not_numbers_are_refused(network: ImitationNetwork, tmp_path: Path) -> None:
    with torch.no_grad():
        next(network.speed_branch.parameters())[0] = torch.nan
    save_imitation(tmp_path / "model.safetensors", network, INFO)
    with pytest.raises(CheckpointError, match="weights that are not numbers"):
        load_imitation(tmp_path / "model.safetensors")


def test_settings_that_cannot_be_end_in_a_sentence() -> None:
    with pytest.raises(ValueError, match=r"found --network.image-height 60, wanted 77 to"):
        ImitationNetworkConfig(image_height=60)
    with pytest.raises(ValueError, match="found the published augmentation beside CAL's recolouring"):
        ImitationConfig(recolour=RecolourConfig())
