from __future__ import annotations

from dataclasses import replace

import pytest
import torch
from torch import Tensor, nn

from caldrive.perception.backbone import Backbone
from caldrive.perception.config import TrainingConfig
from caldrive.perception.optimizer import DECAY, Optimizer

MUON = TrainingConfig(muon=20.0)


def _stepped(config: TrainingConfig, scale: float = 1.0, rate: float = 1e-3) -> tuple[Backbone, dict[str, Tensor]]:
    """A backbone after one step with gradients of this scale, and its weights before."""
    torch.manual_seed(0)
    backbone = Backbone(1 / 8, batch_norm=True)
    before = {name: value.clone() for name, value in backbone.named_parameters()}
    optimizer = Optimizer(backbone, backbone.convolutions(), config)
    for parameter in backbone.parameters():
        parameter.grad = scale * torch.randn_like(parameter)
    optimizer.step(rate)
    return backbone, before


def test_muon_changes_every_kernel_in_all_directions_at_one_rate() -> None:
    backbone, before = _stepped(MUON)
    for name, value in backbone.named_parameters():
        if value.dim() == 4:
            changed = (value - before[name] * (1 - 20 * 1e-3 * DECAY)).flatten(1) / (20 * 1e-3)
            found = torch.linalg.svdvals(changed)
            assert found.min() > 0.5, name  # Muon's five iterations leave them near one
            assert found.max() < 1.5, name


def test_muon_steps_as_far_on_small_gradients_as_on_large_ones() -> None:
    large, small = (_stepped(MUON, scale)[0].convolutions()[3].weight for scale in (100.0, 1e-3))
    torch.testing.assert_close(large, small, atol=1e-3, rtol=0)


def test_kernels_stop_growing_where_the_decay_balances_the_steps() -> None:
    torch.manual_seed(0)
    conv = Backbone(1 / 16).convolutions()[3]
    optimizer, gradient = Optimizer(conv, [conv], MUON), torch.randn_like(conv.weight)
    for _ in range(100):
        conv.weight.grad = gradient.clone()
        optimizer.step(1 / MUON.muon)  # of a length of one
    found = torch.linalg.svdvals(conv.weight.detach().flatten(1))
    assert float(found.mean()) == pytest.approx(1 / DECAY, rel=0.3)


def test_what_is_no_kernel_learns_by_adam() -> None:
    backbone, before = _stepped(MUON)
    other = _stepped(replace(MUON, muon=0.0))[0]
    for (name, value), same in zip(backbone.named_parameters(), other.parameters(), strict=True):
        assert torch.equal(value, same) == (value.dim() != 4), name
    bias = backbone.convolutions()[0].bias
    assert bias is not None
    torch.testing.assert_close((bias - before["stages.0.0.bias"]).abs(), torch.full_like(bias, 1e-3), rtol=1e-3, atol=0)


def test_a_step_leaves_no_gradient_and_at_rate_zero_no_trace() -> None:
    backbone, before = _stepped(MUON, rate=0.0)
    assert all(parameter.grad is None for parameter in backbone.parameters())
    assert all(torch.equal(value, before[name]) for name, value in backbone.named_parameters())


def test_kernels_of_other_memory_are_refused() -> None:
    conv = nn.Conv2d(4, 8, 3)
    with pytest.raises(ValueError, match="wanted channels-last"):
        Optimizer(conv, [conv], MUON)
