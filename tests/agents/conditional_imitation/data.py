"""A small imitation network for the tests' small images, and a training of a few steps."""

from __future__ import annotations

from caldrive.agents.conditional_imitation.config import ImitationConfig, ImitationNetworkConfig
from tests.perception.data import HEIGHT, WIDTH

SMALL = ImitationNetworkConfig(
    backbone="cal", image_width=WIDTH, image_height=HEIGHT, nodes=16, speed_nodes=8, branch_nodes=8,
    image_dropout=0.0, dropout=0.0,
)  # fmt: skip
SHORT = ImitationConfig(
    steps=6, batch=6, warm_up=2, evaluate_every=100, save_every=2, precision="fp32", validation_share=0.3,
)  # fmt: skip
