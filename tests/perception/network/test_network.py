from __future__ import annotations

import pickle
from dataclasses import replace
from pathlib import Path
from typing import Any, get_args

import pytest
import torch
from safetensors.torch import save_file

from caldrive.affordances import BY_NAME, SPECS, AffordanceSpec
from caldrive.perception.network.backbone import CHANNELS, IMAGENET_LAYERS, Backbone
from caldrive.perception.network.checkpoint import CheckpointInfo, save_network
from caldrive.perception.network.config import NETWORKS, BlockConfig, Conditioning, Layer, NetworkConfig, Norm
from caldrive.perception.network.network import Network, NodeGroup, TaskBlock
from tests.perception.data import TINY

ANGLE, HAZARD = BY_NAME["relative_angle"], BY_NAME["hazard_stop"]
F = 12


@pytest.fixture(autouse=True)
def _same_weights() -> None:
    """Drawn differently in each run, six ReLUs are all off once in 64 runs."""
    torch.manual_seed(0)


def test_the_backbone_is_vgg16() -> None:
    convolutions = Backbone(1.0).convolutions()
    assert len(convolutions) == 13
    assert sum(p.numel() for c in convolutions for p in c.parameters()) == 14_714_688


def test_feature_count_is_what_the_backbone_gives() -> None:
    backbone = Backbone(0.25, batch_norm=True)
    assert backbone(torch.zeros(2, 3, 88, 200)).shape == (2, backbone.n_features(88, 200)) == (2, 1536)


def test_the_small_network_stays_below_ten_megabytes(tmp_path: Path) -> None:
    config = NetworkConfig()
    save_network(tmp_path / "model.safetensors", Network(config), CheckpointInfo(config), half=True)
    assert (tmp_path / "model.safetensors").stat().st_size < 10e6


def test_the_paper_network_looks_back_as_far_as_its_red_light_block() -> None:
    with torch.device("meta"):
        network = Network(NETWORKS["paper"])
    assert network.span == 27
    assert network.backbone.n_features(144, 320) == 512 * 4 * 10


@pytest.mark.parametrize("layer", ["dense", "lstm", "gru", "tconv"])
@pytest.mark.parametrize(("length", "dilation"), [(1, 1), (2, 3), (5, 2)])
def test_every_layer_takes_every_sequence(layer: Layer, length: int, dilation: int) -> None:
    block = TaskBlock(BlockConfig(layer, 6, 0.0, length, dilation), HAZARD, F).eval()
    features, command = torch.randn(2, 11, F), torch.zeros(2, 3, dtype=torch.long)
    assert block(features, command).shape == (6, 2)


def test_an_unknown_layer_or_norm_is_named() -> None:
    with pytest.raises(ValueError, match="found layer 'perceptron' of a task block, wanted dense, lstm, gru or tconv"):
        BlockConfig("perceptron")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="found norm 'group' of a task block, wanted batch, layer or none"):
        BlockConfig(norm="group")  # type: ignore[arg-type]


def test_every_affordance_has_a_task_block_in_the_settings() -> None:
    blocks = {name for name, value in vars(NetworkConfig()).items() if isinstance(value, BlockConfig)}
    assert blocks == {spec.name for spec in SPECS}


def test_a_block_looks_at_its_own_frames_only() -> None:
    block = TaskBlock(BlockConfig("dense", 6, 0.0, length=3, dilation=2), HAZARD, F).eval()
    features = torch.randn(1, 6, F, requires_grad=True)
    block(features, torch.zeros(1, 1, dtype=torch.long)).sum().backward()
    assert features.grad is not None
    assert features.grad.abs().sum(2)[0].gt(0).tolist() == [False, True, False, True, False, True]


def test_before_the_first_frame_is_the_first_frame_again() -> None:
    block = TaskBlock(BlockConfig("gru", 6, 0.0, length=4, dilation=2), HAZARD, F).eval()
    features, command = torch.randn(1, 3, F), torch.zeros(1, 1, dtype=torch.long)
    padded = torch.cat([features[:, :1]] * 6 + [features[:, 1:]], dim=1)
    torch.testing.assert_close(block(features, command), block(padded, command))


def test_the_command_switches_between_groups() -> None:
    block = TaskBlock(BlockConfig("dense", 6, 0.0), ANGLE, F).eval()
    features = torch.randn(1, 1, F).expand(3, 1, F)
    together = block(features, torch.arange(3)[:, None])
    assert together.unique().numel() == 3
    for number in range(3):
        alone = block(features[:1], torch.tensor([[number]]))
        torch.testing.assert_close(together[number : number + 1], alone)


@pytest.mark.parametrize("n_samples", [1, 4])
def test_only_the_active_group_receives_gradient(n_samples: int) -> None:
    block = TaskBlock(BlockConfig("tconv", 6, 0.0, length=3), ANGLE, F).train()
    block(torch.randn(n_samples, 3, F), torch.full((n_samples, 1), 2)).sum().backward()
    touched = [any(p.grad is not None for p in group.parameters()) for group in block.groups]
    assert touched == [False, False, True]


def test_in_a_mixed_batch_a_group_learns_from_its_own_samples_only() -> None:
    torch.manual_seed(0)
    block = TaskBlock(BlockConfig("dense", 6, 0.0, norm="layer"), ANGLE, F).train()
    features, command = torch.randn(6, 1, F), torch.tensor([0, 2, 0, 2, 2, 0])[:, None]
    block(features, command).sum().backward()
    mixed = [p.grad for p in block.groups[0].parameters()]
    assert all(p.grad is None for p in block.groups[1].parameters())
    block.zero_grad()
    block(features[command[:, 0] == 0], command[command[:, 0] == 0]).sum().backward()
    for gradient, expected in zip(mixed, (p.grad for p in block.groups[0].parameters()), strict=True):
        torch.testing.assert_close(gradient, expected)


def conditioned(conditioning: Any, spec: AffordanceSpec = ANGLE) -> TaskBlock:
    torch.manual_seed(0)
    return TaskBlock(BlockConfig("gru", 6, 0.0, length=3, norm="layer", conditioning=conditioning), spec, F).eval()


@pytest.mark.parametrize("conditioning", get_args(Conditioning))
def test_the_command_counts_wherever_it_comes_in(conditioning: str) -> None:
    block, features = conditioned(conditioning), torch.randn(1, 3, F)
    together = block(features.expand(3, 3, F), torch.arange(3)[:, None])
    assert together.unique().numel() == 3
    for number in range(3):
        alone = block(features, torch.tensor([[number]]))
        torch.testing.assert_close(together[number : number + 1], alone)


@pytest.mark.parametrize("conditioning", get_args(Conditioning))
def test_an_affordance_that_no_command_changes_knows_no_conditioning(conditioning: str) -> None:
    block, plain = conditioned(conditioning, HAZARD), conditioned("groups", HAZARD)
    features, command = torch.randn(2, 3, F), torch.tensor([[0], [2]])
    torch.testing.assert_close(block(features, command), plain(features, command))


def test_of_the_values_for_all_commands_only_the_chosen_one_learns() -> None:
    block = conditioned("all")
    block(torch.randn(4, 3, F), torch.full((4, 1), 2)).sum().backward()
    gradient = block.group(0).output.weight.grad
    assert gradient is not None
    assert gradient.abs().sum(1).gt(0).tolist() == [False, False, True]


def test_an_unknown_conditioning_is_named() -> None:
    with pytest.raises(ValueError, match="found conditioning 'wheel' of a task block, wanted groups, input or all"):
        BlockConfig(conditioning="wheel")  # type: ignore[arg-type]


def test_all_six_affordances_come_out_for_each_frame() -> None:
    network = Network(TINY).eval()
    features = network.features(torch.randn(8, 3, 32, 64)).view(2, 4, -1)
    outputs = network(features, torch.zeros(2, 4, dtype=torch.long))
    assert {name: tuple(value.shape) for name, value in outputs.items()} == {s.name: (8, s.outputs) for s in SPECS}


def vgg16_state() -> dict[str, torch.Tensor]:
    sizes = [3] + [c for c, depth in zip(CHANNELS, (2, 2, 3, 3, 3), strict=True) for _ in range(depth)]
    return {
        f"features.{n}.{kind}": torch.full((b, a, 3, 3) if kind == "weight" else (b,), n + 0.5, dtype=torch.float16)
        for n, a, b in zip(IMAGENET_LAYERS, sizes, sizes[1:], strict=False)
        for kind in ("weight", "bias")
    }


def test_imagenet_weights_find_their_convolutions(tmp_path: Path) -> None:
    save_file(vgg16_state(), tmp_path / "vgg16.safetensors")
    backbone = Backbone(1.0)
    backbone.load_imagenet(tmp_path / "vgg16.safetensors")
    assert [float(c.weight.detach()[0, 0, 0, 0]) for c in backbone.convolutions()] == [n + 0.5 for n in IMAGENET_LAYERS]


def test_foreign_imagenet_weights_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "other.safetensors"
    with pytest.raises(ValueError, match="missing"):
        Backbone(1.0).load_imagenet(path)
    save_file({"features.0.weight": torch.zeros(8, 3, 3, 3)}, path)
    with pytest.raises(ValueError, match=r"found features\.0\.weight of shape \(8, 3, 3, 3\)"):
        Backbone(1.0).load_imagenet(path)
    with pytest.raises(ValueError, match="type --preset paper"):
        Network(replace(TINY, width=0.25)).backbone.load_imagenet(path)


def test_imagenet_weights_are_read_as_torch_hub_keeps_them_and_nothing_else_is_unpickled(tmp_path: Path) -> None:
    path, backbone = tmp_path / "vgg16-397923af.pth", Backbone(1.0)
    torch.save(vgg16_state(), path)
    backbone.load_imagenet(path)
    assert float(backbone.convolutions()[1].weight.detach()[0, 0, 0, 0]) == 2.5
    for content in (b"", b"no pickle", pickle.dumps(print, protocol=2)):
        path.write_bytes(content)
        with pytest.raises(ValueError, match="no state dict of tensors"):
            backbone.load_imagenet(path)


def alive_after_training(norm: Norm) -> float:
    """Share of a group's nodes that are ever above zero after steps like the first ones of a training."""
    group = NodeGroup(BlockConfig("tconv", 64, 0.0, length=5, norm=norm), 1536, 1).train()
    optimizer = torch.optim.Adam(group.parameters(), 1e-3)
    direction, hidden = torch.randn(1536) / 1536**0.5, []
    group.output.register_forward_pre_hook(lambda module, inputs: hidden.append(inputs[0].detach()))
    for _ in range(60):
        features = torch.randn(32, 1, 1536).relu().expand(-1, 5, -1)
        loss = (group(features)[:, 0] - features[:, 0] @ direction - 0.5 * torch.randn(32)).abs().mean()
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
    return float((torch.stack(hidden[-10:]).view(-1, 64, 3) > 0).any(0).any(1).float().mean())


def test_a_layer_norm_keeps_half_of_the_nodes_over_many_positive_features_alive() -> None:
    assert alive_after_training("none") < 0.25
    assert alive_after_training("layer") > 0.4
