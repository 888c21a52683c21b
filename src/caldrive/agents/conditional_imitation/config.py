"""Settings of conditional imitation learning: its network and its training, and where they come from.

Sources: the CARLA paper (Dosovitskiy et al., CoRL 2017), its supplement S.2.2 and table S.1; the agent that its authors
released; what one of them posted on its training (issues 1 and 19 of the released agent). Where they disagree, the
network that was released goes before the text, as the published figures are its own.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from caldrive.checks import MOST_PIXELS, require_limits, require_within
from caldrive.perception.dataset.config import AugmentationConfig, RecolourConfig
from caldrive.perception.network.config import CELL, MOST_NODES
from caldrive.perception.training.config import LoopConfig

SMALLEST_SIDE = {"published": 77, "cal": CELL}  # pixels; of a smaller image the convolutions leave nothing


@dataclass(frozen=True)
class ImitationNetworkConfig:
    """The network: what sees, how wide its layers are, and how much dropout switches off."""

    backbone: Literal["published", "cal"] = "published"
    """published: eight convolutions without padding (table S.1); cal: the convolutions of CAL's own network."""
    image_width: int = 200
    """Width of the images in pixels."""
    image_height: int = 88
    """Height of the images in pixels."""
    nodes: int = 512
    """Of the layers behind the convolutions, and of the one that joins image and speed."""
    speed_nodes: int = 128
    """Of the two layers behind the speed."""
    branch_nodes: int = 256
    """Of the two layers of each branch."""
    image_dropout: float = 0.3
    """Share of the nodes behind the convolutions that dropout switches off, as in the released agent."""
    dropout: float = 0.5
    """Share of the other hidden nodes, but for a branch's second layer."""

    def __post_init__(self) -> None:
        sides, nodes = (SMALLEST_SIDE[self.backbone], MOST_PIXELS), (1, MOST_NODES)
        limits = {
            "image_width": sides, "image_height": sides, "nodes": nodes, "speed_nodes": nodes, "branch_nodes": nodes,
            "image_dropout": (0.0, 0.99), "dropout": (0.0, 0.99),
        }  # fmt: skip
        require_limits(vars(self), limits, vars(ImitationNetworkConfig), "network")

    @property
    def image_size(self) -> tuple[int, int]:
        """(height, width) of the images in pixels."""
        return self.image_height, self.image_width


@dataclass(frozen=True)
class ImitationWeights:
    """What each squared error counts: 0.95 (0.45 steer + 0.05 gas + 0.5 brake) + 0.05 speed, as posted by the author of
    the released agent. His later code (coiltraine) has 0.5, 0.45, 0.05 in the brackets."""

    steer: float = 0.4275
    """Weight of the steering's squared error."""
    throttle: float = 0.0475
    """Weight of the throttle's."""
    brake: float = 0.475
    """Weight of the brake's."""
    speed: float = 0.05
    """Weight of the speed's, which a branch of its own predicts from the image alone, as a share of 25 m/s."""

    def __post_init__(self) -> None:
        require_limits(vars(self), dict.fromkeys(vars(self), (0.0, math.inf)), vars(type(self)), "weights")


@dataclass(frozen=True)
class ImitationConfig(LoopConfig):
    """How the network learns. The published training had 294,000 steps of 120 images, ours has as many images as CAL's
    has: the rate falls along a cosine instead of by halves."""

    learning_rate: float = 2e-4
    """Base learning rate."""
    betas: tuple[float, float] = (0.7, 0.85)
    """Adam's, as published."""
    balance: float = 0.0
    """Each command has the same share of a batch. Of the frames of one command, 0 draws all evenly, as published, 1 in
    inverse proportion to the frequency of their steering."""
    weights: ImitationWeights = ImitationWeights()
    """What each squared error counts."""
    wheel_angle: float | None = None
    """Angle of the front wheels at full steering, degrees, of the car that was recorded. The labels of cameras aside
    depend on it. Without it 35 for recordings of caldrive, 70, as CARLA's car has, for HDF5 files of others."""
    published_augmentation: bool = True
    """The augmentation that the authors of the released agent posted, in the place of CAL's."""
    recolour: RecolourConfig = RecolourConfig(enabled=False)
    """Other colours for each class of things, where the recording has semantic images: CAL's own, not published."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.wheel_angle is not None:
            require_within("--wheel-angle", self.wheel_angle, 1.0, 90.0, 35.0)
        if self.published_augmentation and self.recolour.enabled:
            raise ValueError(
                "found the published augmentation beside CAL's recolouring, wanted one of them: type "
                "--recolour.enabled False, or --published-augmentation False"
            )


IMITATION_TRAININGS = {
    "published": ImitationConfig(),
    # What CAL's own network learns with, so that the two differ in what they learn alone.
    "cal-backbone": ImitationConfig(
        learning_rate=1e-3, betas=(0.9, 0.999), published_augmentation=False, augmentation=AugmentationConfig(),
        recolour=RecolourConfig(),
    ),
}  # fmt: skip
IMITATION_NETWORKS = {
    "published": ImitationNetworkConfig(),
    "cal-backbone": ImitationNetworkConfig(backbone="cal"),
}
