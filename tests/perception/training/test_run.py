"""A step of a training: its rate, and its gradient."""

from __future__ import annotations

import pytest
import torch

from caldrive.perception.training.config import TrainingConfig
from caldrive.perception.training.run import gradient_step, learning_rate


def test_the_rate_warms_up_and_falls() -> None:
    config = TrainingConfig(steps=100, warm_up=10, learning_rate=1.0, final_rate=0.1)
    rates = [learning_rate(step, config.steps, config) for step in range(100)]
    assert rates[0] == pytest.approx(0.1)
    assert max(rates) == rates[10] == 1.0
    assert rates[99] == pytest.approx(0.1, abs=0.01)
    assert rates[10:] == sorted(rates[10:], reverse=True)


@pytest.mark.parametrize(("rate", "clip"), [(0.0, 5.0), (0.01, 5.0), (0.01, 0.5)])
def test_a_step_is_as_long_as_the_rate_and_its_gradient_no_longer_than_the_clip(rate: float, clip: float) -> None:
    weight = torch.nn.Parameter(torch.zeros(2))
    optimizer = torch.optim.Adam([weight], lr=1.0)
    gradient_step(optimizer, (torch.tensor([3.0, -4.0]) * weight).sum(), rate, clip)
    assert weight.detach().tolist() == pytest.approx([-rate, rate])  # Adam's first step is the gradient's sign
    assert optimizer.state[weight]["exp_avg"].norm() == pytest.approx(0.1 * clip, rel=1e-3)  # of a gradient of 5
    assert weight.grad is None
