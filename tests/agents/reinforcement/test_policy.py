"""The policy: its shapes, its distributions, and what it begins with."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from caldrive.agents.reinforcement.config import FRAME, N_FRAMES, PolicyConfig
from caldrive.agents.reinforcement.inputs import control_of
from caldrive.agents.reinforcement.policy import Betas, Choices, Policy

PAPER = PolicyConfig("frames", "carla2017", repeat=1, memory=False, hidden=512)


def some_inputs(config: PolicyConfig, n: int) -> dict[str, torch.Tensor]:
    inputs = {"numbers": torch.rand(n, config.n_numbers)}
    if config.sees == "frames":
        inputs["frames"] = torch.randint(0, 256, (n, N_FRAMES, FRAME, FRAME), dtype=torch.uint8)
    return inputs


@pytest.mark.parametrize("config", [PAPER, PolicyConfig(), PolicyConfig("features", n_features=20)])
def test_each_decision_has_an_action_a_density_and_an_entropy(config: PolicyConfig) -> None:
    actions = Policy(config)(some_inputs(config, 3))
    sampled = actions.sample()
    assert sampled.shape == actions.best().shape == ((3,) if config.action == "carla2017" else (3, 2))
    assert actions.log_prob(sampled).shape == actions.entropy().shape == (3,)
    control_of(config.action, sampled[0].numpy())


def test_the_papers_network_has_two_and_a_half_million_weights() -> None:
    assert sum(weight.numel() for weight in Policy(PAPER).parameters()) == pytest.approx(2.5e6, rel=0.1)


def test_a_beta_policy_stays_within_the_actions_and_its_best_is_the_mean() -> None:
    torch.manual_seed(0)
    betas = Betas(torch.tensor([[3.0, -2.0, -1.0, 4.0]]).repeat(4000, 1))
    sampled = betas.sample()
    assert sampled.abs().max() <= 1
    assert sampled.mean(0).numpy() == pytest.approx(betas.best()[0].numpy(), abs=0.02)


def test_the_density_of_a_beta_policy_is_that_of_its_samples() -> None:
    torch.manual_seed(0)
    betas = Betas(torch.tensor([[1.0, 0.0, 2.0, 0.5]]).repeat(200_000, 1))
    throttle, _ = betas.sample().T
    share = ((throttle > 0.1) & (throttle < 0.2)).float().mean()
    near = torch.stack((torch.linspace(0.1, 0.2, 50), torch.zeros(50)), 1)
    steering = Betas(torch.tensor([[1.0, 0.0, 2.0, 0.5]]).repeat(50, 1))
    marginal = steering.log_prob(near) - steering._shares.log_prob(torch.full((50, 2), 0.5))[:, 1]
    assert float(marginal.exp().mean() * 0.05) == pytest.approx(float(share), rel=0.05)


def test_an_action_at_the_very_end_has_a_density() -> None:
    betas = Betas(torch.tensor([[4.0, 4.0, 4.0, 4.0]]))
    assert torch.isfinite(betas.log_prob(torch.tensor([[1.0, -1.0]]))).all()


def test_the_best_of_nine_is_the_likeliest() -> None:
    outputs = torch.zeros(1, 9)
    outputs[0, 4] = 2.0
    assert Choices(outputs).best().tolist() == [4]


def test_a_new_policy_rather_drives_than_brakes_and_hardly_steers() -> None:
    torch.manual_seed(0)
    throttle, steer = Policy(PolicyConfig())(some_inputs(PolicyConfig(), 1)).best()[0].tolist()
    assert 0.1 < throttle < 0.5
    assert abs(steer) < 0.05
    chances = Policy(PAPER)(some_inputs(PAPER, 1))
    assert np.exp(chances.entropy().item()) == pytest.approx(9, rel=0.01)
