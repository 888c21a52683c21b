"""Settings of the network and of its training, and their presets."""

from __future__ import annotations

from dataclasses import dataclass

from caldrive.checks import MOST_PIXELS

MOST_FRAMES, MOST_NODES, MOST_WIDTH = 1000, 10_000, 10.0  # more than anyone builds


@dataclass(frozen=True)
class BlockConfig:
    """A task block: kind of layer (dense, lstm, gru or tconv), its nodes (for each command where the affordance is
    conditional), dropout ratio, length of its sequence in frames, dilation (2: every other frame), and its norm.

    norm: batch; layer (over a sample's nodes), for conditional blocks, whose batch norm would see only the few samples
    of a batch that have its command; or none, where a small network's nodes die one after the other: features are
    never negative, and a few steps at its high rate push all of a node's sums below zero for good.
    """

    layer: str = "dense"
    nodes: int = 64
    dropout: float = 0.25
    length: int = 1
    dilation: int = 1
    norm: str = "batch"

    def __post_init__(self) -> None:
        within = 1 <= self.length <= MOST_FRAMES and 1 <= self.dilation <= MOST_FRAMES and 1 <= self.nodes <= MOST_NODES
        if not within or not 0 <= self.dropout < 1:
            raise ValueError(
                f"{self} cannot be built: give 1 to {MOST_NODES} nodes, length and dilation from 1 to {MOST_FRAMES}, "
                "and a dropout from 0 to less than 1"
            )

    @property
    def span(self) -> int:
        """Frames from the oldest one that the block looks at to the newest, both included."""
        return (self.length - 1) * self.dilation + 1


@dataclass(frozen=True)
class PerceptionConfig:
    """The network: image size in pixels, width of the convolutions as a share of VGG16's, batch norm in the backbone,
    and one task block for each affordance. The default is the small network that is trained from scratch."""

    image_width: int = 200
    image_height: int = 88
    width: float = 0.25
    batch_norm: bool = True
    hazard_stop: BlockConfig = BlockConfig("tconv", 64, 0.25, length=5, dilation=2)
    red_light: BlockConfig = BlockConfig("dense", 64, 0.25)
    speed_sign: BlockConfig = BlockConfig("dense", 64, 0.25)
    vehicle_distance: BlockConfig = BlockConfig("dense", 64, 0.1)
    relative_angle: BlockConfig = BlockConfig("tconv", 64, 0.0, length=5, dilation=2, norm="layer")
    center_distance: BlockConfig = BlockConfig("tconv", 64, 0.0, length=5, dilation=2, norm="layer")

    def __post_init__(self) -> None:
        sides = self.image_width, self.image_height
        if not 0 < self.width <= MOST_WIDTH or not all(1 <= side <= MOST_PIXELS for side in sides):
            raise ValueError(
                f"a network of width {self.width} for {sides[0]} x {sides[1]} pixels cannot be built: give more than 0 "
                f"and up to {MOST_WIDTH:g} as its width, and 1 to {MOST_PIXELS} pixels a side"
            )


PERCEPTIONS = {
    "small": PerceptionConfig(),
    # The best task blocks of the paper's supplement (table of best task block parameters) on VGG16 as it is.
    "paper": PerceptionConfig(
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
