"""What a training begins with: a trained network, or some of its blocks."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
import torch

from caldrive.perception.network.checkpoint import load_network
from caldrive.perception.network.tensor_file import CheckpointError
from caldrive.perception.training.initial import different_blocks, with_initial_weights
from caldrive.perception.training.train import train
from tests.perception.data import SHORT, TINY


def test_a_run_may_begin_with_a_trained_network(folder: Path, tmp_path: Path) -> None:
    first = train(SHORT, folder, tmp_path / "first", TINY)
    still = replace(SHORT, steps=1, learning_rate=1e-9, initial=str(first))
    second = train(still, folder, tmp_path / "second", TINY)
    before, after = (dict(load_network(path)[0].named_parameters()) for path in (first, second))
    assert torch.equal(before["backbone.stages.0.0.weight"], after["backbone.stages.0.0.weight"])
    bias = "blocks.hazard_stop.groups.0.output.bias"  # calibrated once, not twice
    torch.testing.assert_close(before[bias], after[bias])
    first.unlink()  # what a run began with is needed no more once it has a state
    assert train(still, folder, tmp_path / "second", TINY) == second
    with pytest.raises(CheckpointError, match="found no file"):
        train(still, folder, tmp_path / "again", TINY)


def test_blocks_that_are_built_differently_begin_with_new_weights(folder: Path, tmp_path: Path) -> None:
    first = train(SHORT, folder, tmp_path / "first", TINY)
    still = replace(SHORT, steps=1, learning_rate=1e-9, initial=str(first))
    longer = replace(TINY, hazard_stop=replace(TINY.hazard_stop, dilation=2))
    second = load_network(train(still, folder, tmp_path / "second", longer))[0]
    before, after = (dict(network.named_parameters()) for network in (load_network(first)[0], second))
    same = {name for name in before if torch.equal(before[name], after[name])}
    assert {"backbone.stages.0.0.weight", "blocks.relative_angle.groups.0.layer.weight"} <= same
    assert "blocks.hazard_stop.groups.0.layer.weight" not in same
    assert second.blocks["hazard_stop"].config == longer.hazard_stop
    assert different_blocks(TINY, longer) == ["hazard_stop"]
    assert different_blocks(TINY, replace(TINY, red_light=replace(TINY.red_light, dropout=0.9))) == []


def test_a_run_does_not_begin_with_a_network_of_another_kind(folder: Path, tmp_path: Path) -> None:
    first = train(replace(SHORT, steps=1), folder, tmp_path / "first", TINY)
    still = replace(SHORT, steps=1, initial=str(first))
    with pytest.raises(CheckpointError, match="another width or image size"):
        train(still, folder, tmp_path / "third", replace(TINY, width=0.5))


def test_a_network_remembers_what_it_began_with_also_when_it_is_taken_up_without(folder: Path, tmp_path: Path) -> None:
    first = train(replace(SHORT, steps=1), folder, tmp_path / "first", TINY)
    begun = replace(SHORT, initial=str(first))
    train(begun, folder, tmp_path / "second", TINY, stop=lambda step: step == 4)
    done = train(SHORT, folder, tmp_path / "second", TINY)
    assert load_network(done)[1].training["initial"] == first.name


def test_imagenets_weights_are_found_in_the_cache_and_not_looked_for_beside_a_trained_network(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("TORCH_HOME", str(tmp_path))
    with pytest.raises(ValueError, match=r"found no vgg16-\*\.pth"):
        with_initial_weights(replace(SHORT, imagenet="cache"))
    assert with_initial_weights(replace(SHORT, imagenet="cache", initial="a.safetensors")).imagenet == "none"
    weights = tmp_path / "hub" / "checkpoints" / "vgg16-397923af.pth"
    weights.parent.mkdir(parents=True)
    weights.touch()
    assert with_initial_weights(replace(SHORT, imagenet="cache")).imagenet == str(weights)
