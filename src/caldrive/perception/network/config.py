"""Settings of the network: its backbone, a task block for each affordance, and the presets.

A checkpoint's header keeps them under the same names, so a field that is renamed makes older checkpoints unreadable.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

from caldrive.checks import MOST_PIXELS

Layer = Literal["dense", "lstm", "gru", "tconv"]
Norm = Literal["batch", "layer", "none"]
Conditioning = Literal["groups", "input", "all"]

CELL = 32  # pixels a side that the backbone makes one place of; of a smaller image nothing is left
MOST_FRAMES, MOST_NODES, MOST_WIDTH = 1000, 10_000, 10.0  # more than anyone builds


@dataclass(frozen=True)
class BlockConfig:
    """A task block: one affordance from the features of one frame, or of a sequence of frames."""

    layer: Layer = "dense"
    """Its layer; tconv is a temporal convolution."""
    nodes: int = 64
    """Nodes of the layer; as many for each command where there are groups of nodes for the commands."""
    dropout: float = 0.25
    """Share of the nodes that dropout switches off in training."""
    length: int = 1
    """Frames in its sequence. A block with more than one is temporal."""
    dilation: int = 1
    """Distance between two frames of the sequence; 2 takes every other frame."""
    norm: Norm = "batch"
    """Norm after the layer: batch; layer, over a sample's nodes, for conditional blocks, as batch norm would see only
    the few samples of a batch that have their command; or none. Without a norm the nodes of a small network die one by
    one: features are never negative, and a few steps at its high rate push all of a node's sums below zero for good."""
    conditioning: Conditioning = "groups"
    """Where the command comes in, in a block whose affordance depends on it (section 3.1 and supplement 1.3): groups of
    nodes, of which it switches one on; input, beside the features; or all, in the controller, for which one group
    of nodes predicts the values of all three commands."""

    def __post_init__(self) -> None:
        for name, words in (("layer", Layer), ("norm", Norm), ("conditioning", Conditioning)):
            if getattr(self, name) not in get_args(words):
                wanted = _either(get_args(words))
                raise ValueError(f"found {name} {getattr(self, name)!r} of a task block, wanted {wanted}")
        within = 1 <= self.length <= MOST_FRAMES and 1 <= self.dilation <= MOST_FRAMES and 1 <= self.nodes <= MOST_NODES
        if not within or not 0 <= self.dropout < 1:
            raise ValueError(
                f"found a task block of {self.nodes} nodes, dropout {self.dropout}, length {self.length} and dilation "
                f"{self.dilation}, wanted 1 to {MOST_NODES} nodes, a dropout from 0 to less than 1, and length and "
                f"dilation from 1 to {MOST_FRAMES}"
            )

    @property
    def temporal(self) -> bool:
        """Whether it looks at more than one frame."""
        return self.length > 1

    @property
    def span(self) -> int:
        """Frames from the oldest one that the block looks at to the newest, both included."""
        return (self.length - 1) * self.dilation + 1


@dataclass(frozen=True)
class NetworkConfig:
    """The network. The default is the small one, which is trained from scratch."""

    image_width: int = 200
    """Width of the images in pixels."""
    image_height: int = 88
    """Height of the images in pixels."""
    width: float = 0.25
    """Channels of the convolutions as a share of VGG16's."""
    batch_norm: bool = True
    """Batch norm in the backbone, which a narrow network trained from scratch needs."""
    hazard_stop: BlockConfig = BlockConfig("tconv", 64, 0.25, length=5, dilation=2)
    """Task block of the hazard stop."""
    red_light: BlockConfig = BlockConfig("dense", 64, 0.25)
    """Task block of the red light."""
    speed_sign: BlockConfig = BlockConfig("dense", 64, 0.25)
    """Task block of the speed sign."""
    vehicle_distance: BlockConfig = BlockConfig("dense", 64, 0.1)
    """Task block of the distance to the vehicle ahead."""
    relative_angle: BlockConfig = BlockConfig("tconv", 64, 0.0, length=5, dilation=2, norm="layer")
    """Task block of the relative angle, with nodes for each command."""
    center_distance: BlockConfig = BlockConfig("tconv", 64, 0.0, length=5, dilation=2, norm="layer")
    """Task block of the distance to the centre line, with nodes for each command."""

    def __post_init__(self) -> None:
        sides = self.image_width, self.image_height
        if not 0 < self.width <= MOST_WIDTH or not all(CELL <= side <= MOST_PIXELS for side in sides):
            raise ValueError(
                f"found a network of width {self.width} for images of {sides[0]} x {sides[1]} pixels, wanted a width "
                f"of more than 0 and at most {MOST_WIDTH:g}, and {CELL} to {MOST_PIXELS} pixels a side"
            )

    @property
    def image_size(self) -> tuple[int, int]:
        """(height, width) of the images in pixels."""
        return self.image_height, self.image_width


def _either(words: tuple[str, ...]) -> str:
    return f"{', '.join(words[:-1])} or {words[-1]}"


NETWORKS = {
    "small": NetworkConfig(),
    # The best task blocks of the paper's supplement (table of best task block parameters) on VGG16 as it is.
    "paper": NetworkConfig(
        image_width=320,
        image_height=144,
        width=1.0,
        batch_norm=False,
        hazard_stop=BlockConfig("tconv", 160, 0.68, length=6),
        red_light=BlockConfig("gru", 185, 0.27, length=14, dilation=2),
        speed_sign=BlockConfig("dense", 160, 0.55),
        vehicle_distance=BlockConfig("gru", 160, 0.38, length=11),
        relative_angle=BlockConfig("tconv", 100, 0.44, length=10),
        center_distance=BlockConfig("tconv", 100, 0.44, length=10),
    ),
}
