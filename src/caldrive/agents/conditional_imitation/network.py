"""The network of conditional imitation learning: image, speed and command to steering, throttle and brake.

    image  -> convolutions -> 512 -> 512 -+-> 512 -> the command's branch: 256 -> 256 -> steer, throttle, brake
    speed  -> 128 -> 128 -----------------+
    image  -> ... the same 512 -----------> 256 -> 256 -> speed

The CARLA paper's table S.1 has three layers behind the speed, the released agent two, which are taken. Its fourth
branch, for "follow the lane", has no counterpart here: the command is straight but from 20 m before a turn to its end.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn

from caldrive.agents.conditional_imitation.config import ImitationNetworkConfig
from caldrive.perception.images import normalise
from caldrive.perception.network.backbone import Backbone
from caldrive.perception.network.network import COMMANDS

SPEED_SCALE = 25.0  # m/s, what speeds are divided by, as in the released agent
OUTPUTS = ("steer", "throttle", "brake")
# Kernel, stride and channels of the published convolutions, all without padding.
PUBLISHED = ((5, 2, 32), (3, 1, 32), (3, 2, 64), (3, 1, 64), (3, 2, 128), (3, 1, 128), (3, 1, 256), (3, 1, 256))
BIAS = 0.1  # of every layer before its first step
CAL_WIDTH = 0.25  # of the backbone of CAL's small network


def _published(n_in: int = 3) -> nn.Sequential:
    """The eight convolutions, each with batch norm and ReLU."""
    layers: list[nn.Module] = []
    for kernel, stride, n_out in PUBLISHED:
        layers += [nn.Conv2d(n_in, n_out, kernel, stride), nn.BatchNorm2d(n_out), nn.ReLU()]
        n_in = n_out
    return nn.Sequential(*layers, nn.Flatten())


def _dense(n_in: int, n_out: int, dropout: float) -> list[nn.Module]:
    """A hidden layer."""
    return [nn.Linear(n_in, n_out), *([nn.Dropout(dropout)] if dropout else []), nn.ReLU()]


class ImitationNetwork(nn.Module):
    """Images (N, 3, H, W), by `prepared`, speeds (N,) in m/s and the commands' numbers (N,) to controls (N, 3), see
    `OUTPUTS`, and the speeds (N,) in m/s that the images alone suggest."""

    def __init__(self, config: ImitationNetworkConfig) -> None:
        super().__init__()
        self.config = config
        nodes, branch = config.nodes, config.branch_nodes
        self.trunk: nn.Module = Backbone(CAL_WIDTH, batch_norm=True) if config.backbone == "cal" else _published()
        n_features = self._features()
        image = _dense(n_features, nodes, config.image_dropout) + _dense(nodes, nodes, config.image_dropout)
        self.image = nn.Sequential(*image)
        self.speed = nn.Sequential(
            *_dense(1, config.speed_nodes, config.dropout),
            *_dense(config.speed_nodes, config.speed_nodes, config.dropout),
        )
        self.join = nn.Sequential(*_dense(nodes + config.speed_nodes, nodes, config.dropout))
        self.branches = nn.ModuleList(self._branch(branch, len(OUTPUTS)) for _ in COMMANDS)
        self.speed_branch = self._branch(branch, 1)
        for layer in self.modules():
            if isinstance(layer, nn.Linear | nn.Conv2d) and not (config.backbone == "cal" and layer.weight.dim() > 2):
                assert layer.bias is not None
                nn.init.xavier_uniform_(layer.weight)
                nn.init.constant_(layer.bias, BIAS)

    def _features(self) -> int:
        """What the convolutions make of an image, counted without making any."""
        if isinstance(self.trunk, Backbone):
            return self.trunk.n_features(*self.config.image_size)
        sides = list(self.config.image_size)
        for kernel, stride, _ in PUBLISHED:
            sides = [(side - kernel) // stride + 1 for side in sides]
        return PUBLISHED[-1][2] * sides[0] * sides[1]

    def prepared(self, images: Tensor) -> Tensor:
        """Images by `to_float`, in [0, 1] and on the CPU, as the convolutions take them: those of CAL with ImageNet's
        mean 0 and deviation 1, in place."""
        return normalise(images) if self.config.backbone == "cal" else images

    def _branch(self, nodes: int, n_out: int) -> nn.Sequential:
        layers = _dense(self.config.nodes, nodes, self.config.dropout) + _dense(nodes, nodes, 0.0)
        return nn.Sequential(*layers, nn.Linear(nodes, n_out))

    def forward(self, images: Tensor, speed: Tensor, command: Tensor) -> tuple[Tensor, Tensor]:
        """As the class says."""
        return self.act(self.image(self.trunk(images)), speed, command)

    def act(self, image: Tensor, speed: Tensor, command: Tensor) -> tuple[Tensor, Tensor]:
        """The same from what the image was made into (N, nodes)."""
        joined = self.join(torch.cat((image, self.speed(speed[:, None] / SPEED_SCALE)), dim=1))
        by_command = torch.stack([branch(joined) for branch in self.branches], dim=1)  # (N, commands, 3)
        controls = by_command[torch.arange(len(command), device=command.device), command]
        return controls, self.speed_branch(image)[:, 0] * SPEED_SCALE
