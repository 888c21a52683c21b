from __future__ import annotations

import json
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import pytest
import torch
from safetensors.torch import save_file

from caldrive.affordances import describe
from caldrive.files import as_type
from caldrive.perception.network import checkpoint, tensor_file
from caldrive.perception.network.checkpoint import CheckpointInfo, load_network, read_info, save_network
from caldrive.perception.network.config import NETWORKS, NetworkConfig
from caldrive.perception.network.network import Network
from caldrive.perception.network.tensor_file import CheckpointError, write_tensors
from tests.perception.data import TINY

INFO = CheckpointInfo(TINY, {"train_frames": 10}, {"loss": 0.5}, {"steps": 3}, seed=4)


@pytest.fixture
def network() -> Network:
    torch.manual_seed(0)
    return Network(TINY).eval()


def test_a_network_comes_back_with_all_that_belongs_to_it(network: Network, tmp_path: Path) -> None:
    save_network(tmp_path / "model.safetensors", network, INFO)
    loaded, info = load_network(tmp_path / "model.safetensors")
    assert info == INFO
    assert not loaded.training
    for name, value in network.state_dict().items():
        assert torch.equal(loaded.state_dict()[name], value)


def test_half_precision_halves_the_file_and_hardly_changes_the_outputs(network: Network, tmp_path: Path) -> None:
    whole, half = tmp_path / "whole.safetensors", tmp_path / "half.safetensors"
    save_network(whole, network, INFO)
    save_network(half, network, INFO, half=True)
    assert half.stat().st_size < 0.65 * whole.stat().st_size
    image = torch.randn(1, 3, 32, 64)
    with torch.no_grad():
        torch.testing.assert_close(load_network(half)[0].features(image), network.features(image), rtol=0, atol=0.02)


@pytest.mark.parametrize("preset", ["small", "paper"])
def test_configurations_survive_a_dictionary(preset: str) -> None:
    config = NETWORKS[preset]
    assert as_type(json.loads(json.dumps(asdict(config))), NetworkConfig) == config


def test_missing_damaged_and_foreign_files_are_told_apart(network: Network, tmp_path: Path) -> None:
    path = tmp_path / "model.safetensors"
    with pytest.raises(CheckpointError, match="found no file"):
        load_network(path)
    save_network(path, network, INFO)
    path.write_bytes(path.read_bytes()[:-100])
    with pytest.raises(CheckpointError, match="damaged"):
        load_network(path)
    save_file({"a": torch.zeros(1)}, path)
    with pytest.raises(CheckpointError, match=r"no network of caldrive"):
        load_network(path)
    write_tensors(path, {"a": torch.zeros(1)}, {"kind": "training"})
    with pytest.raises(CheckpointError, match=r"model\.safetensors"):
        load_network(path)


def test_weights_of_another_agent_are_refused_by_its_name(tmp_path: Path) -> None:
    write_tensors(tmp_path / "model.safetensors", {"weight": torch.zeros(1)}, {"kind": "cil"})
    with pytest.raises(CheckpointError, match="weights of the agent cil, wanted those of cal: type --agent cil"):
        read_info(tmp_path / "model.safetensors")


def test_weights_of_another_network_are_refused(network: Network, tmp_path: Path) -> None:
    save_network(tmp_path / "model.safetensors", network, CheckpointInfo(NETWORKS["small"]))
    with pytest.raises(CheckpointError, match=r"do not fit|cannot be read"):
        load_network(tmp_path / "model.safetensors")


HEADERS: list[dict[str, Any]] = [
    {"config": asdict(TINY) | {"wings": 2}}, {"config": {"red_light": {"wings": 2}}}, {"metrics": {"loss": "low"}},
    {"seed": None}, {"ranges": 3}, {"config": asdict(TINY) | {"width": 1e30}}, {"config": {"image_width": 0}},
    {"config": asdict(TINY) | {"image_height": 31}},
    {"config": {"red_light": {"length": 0}}}, {"config": {"red_light": {"dilation": -1}}},
    {"data": {"train_classes": 3}}, {"data": {"validation_episodes": 3}}, {"data": {"wings": 2}},
]  # fmt: skip


@pytest.mark.parametrize("header", HEADERS, ids=str)
def test_headers_that_say_something_else_are_refused(header: dict[str, Any], network: Network, tmp_path: Path) -> None:
    path = tmp_path / "model.safetensors"
    whole = {"kind": "network", "specs": describe()} | asdict(INFO)
    write_tensors(path, network.state_dict(), whole | header)
    with pytest.raises(CheckpointError, match=r"do not fit|cannot be read"):
        load_network(path)
    write_tensors(path, network.state_dict(), {"kind": "network"} | header)
    with pytest.raises(CheckpointError, match="other affordances"):
        load_network(path)


def test_other_affordances_and_formats_are_refused(
    network: Network, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    save_network(tmp_path / "model.safetensors", network, INFO)
    with monkeypatch.context() as patch:
        patch.setattr(checkpoint, "describe", list)
        with pytest.raises(CheckpointError, match="other affordances"):
            load_network(tmp_path / "model.safetensors")
    monkeypatch.setattr(tensor_file, "FORMAT_VERSION", 99)
    with pytest.raises(CheckpointError, match=r"found format 2 .* wanted 99"):
        load_network(tmp_path / "model.safetensors")


def test_weights_that_are_not_numbers_are_refused(network: Network, tmp_path: Path) -> None:
    next(iter(network.blocks.parameters())).data[0] = float("nan")
    save_network(tmp_path / "model.safetensors", network, INFO)
    with pytest.raises(CheckpointError, match="not numbers"):
        load_network(tmp_path / "model.safetensors")


def test_variances_below_nothing_are_refused(tmp_path: Path) -> None:
    network = Network(NETWORKS["small"])
    network.get_buffer("backbone.norms.0.running_var")[0] = -1.0
    save_network(tmp_path / "model.safetensors", network, CheckpointInfo(network.config))
    with pytest.raises(CheckpointError, match="variances less than 0"):
        load_network(tmp_path / "model.safetensors")


@pytest.mark.parametrize("classes", [{"red_light": [1, 2, 3]}, {"wings": [1, 2]}, {"red_light": [0, 0]}], ids=str)
def test_counts_of_other_classes_are_refused(classes: dict[str, Any], network: Network, tmp_path: Path) -> None:
    save_network(tmp_path / "model.safetensors", network, replace(INFO, data={"train_classes": classes}))
    with pytest.raises(CheckpointError, match="counts of other classes"):
        load_network(tmp_path / "model.safetensors")


def test_a_header_of_nothing_is_foreign(tmp_path: Path) -> None:
    text = b'{"__metadata__":null}  '
    (tmp_path / "model.safetensors").write_bytes(len(text).to_bytes(8, "little") + text)
    with pytest.raises(CheckpointError, match=r"no network of caldrive"):
        load_network(tmp_path / "model.safetensors")


@pytest.mark.parametrize("size", [0.0, -1.0])
def test_ranges_that_hold_nothing_are_refused(size: float, network: Network, tmp_path: Path) -> None:
    save_network(tmp_path / "model.safetensors", network, replace(INFO, ranges=(size,) * 13))
    with pytest.raises(CheckpointError, match="not more than 0"):
        load_network(tmp_path / "model.safetensors")


def test_what_is_known_of_a_network_is_read_without_its_weights(
    network: Network, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    save_network(tmp_path / "model.safetensors", network, INFO)
    monkeypatch.setattr(Path, "read_bytes", lambda path: pytest.fail(f"read all of {path}"))
    assert read_info(tmp_path / "model.safetensors") == INFO


def test_settings_that_ask_for_more_memory_than_there_is_are_refused_before_it_is_taken(
    network: Network, tmp_path: Path
) -> None:
    huge = replace(TINY, width=10.0, image_width=4096, image_height=4096)  # features of 300 MB an image
    huge = replace(huge, red_light=replace(huge.red_light, nodes=10_000))  # and 9 TB of weights for them
    save_network(tmp_path / "model.safetensors", network, replace(INFO, config=huge))
    with pytest.raises(CheckpointError, match="do not fit its own settings"):
        load_network(tmp_path / "model.safetensors")


@pytest.mark.parametrize("value", [0.0, 0.3, 1e-40])
def test_weights_that_are_all_alike_are_refused(value: float, network: Network, tmp_path: Path) -> None:
    network.get_parameter("blocks.speed_sign.groups.0.layer.weight").data[:] = value
    save_network(tmp_path / "model.safetensors", network, INFO)
    with pytest.raises(
        CheckpointError, match=r"weights blocks\.speed_sign\.groups\.0\.layer\.weight that are all alike"
    ):
        load_network(tmp_path / "model.safetensors")


def test_a_norm_that_lets_nothing_through_is_refused(network: Network, tmp_path: Path) -> None:
    network.get_parameter("backbone.norms.4.weight").data[:] = 0.0
    save_network(tmp_path / "model.safetensors", network, INFO)
    with pytest.raises(CheckpointError, match=r"backbone\.norms\.4\.weight that are all alike"):
        load_network(tmp_path / "model.safetensors")


def test_ranges_of_another_backbone_are_refused(network: Network, tmp_path: Path) -> None:
    save_network(tmp_path / "model.safetensors", network, replace(INFO, ranges=(1.0,) * 3))
    with pytest.raises(CheckpointError, match="3 ranges of integers for 13 convolutions"):
        load_network(tmp_path / "model.safetensors")
