"""Settings of the network and of its training, and their presets."""

from __future__ import annotations

from dataclasses import dataclass

from caldrive.config import MOST_PIXELS

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


@dataclass(frozen=True)
class TrainingConfig:
    """How the network learns: Adam with a warm-up and a cosine down to final_rate times the base rate.

    batch: windows a step; window: consecutive frames of each that give a loss; clip: largest norm of the gradient.
    augment: colours, light, blur and noise; repaint: where the recording has semantic images, also the colours of what
    stands there. others: share of the windows that are seen under another command, where one could be given.
    angle_weight, segmentation: what the relative angle's loss and the second lesson's (where the recording has semantic
    images; 0 leaves it out) count while the backbone learns; the other affordances' count 1.
    block_steps: after the others, steps in which the task blocks that look back learn alone, from block_batch windows
    with their history, whose frames the finished backbone saw once; until then a window is seen as if its stream began
    there. 0: the blocks see their history from the first step on.
    balance: 0 draws windows evenly, 1 in inverse proportion to the frequency of the rarest label in them.
    at_once: frames that pass the backbone together, where a batch would find no room in memory, None for all; without
    batch norm only, which looks at a whole batch. cache_gb: decoded images are kept in memory up to this size.
    precision: auto, fp32 or bf16. device: cpu, cuda, or auto for a GPU where there is one. initial: file of the network
    to begin with, None for a new one.
    """

    steps: int = 11_000
    batch: int = 64
    window: int = 1
    learning_rate: float = 1e-3
    warm_up: int = 100
    final_rate: float = 0.02
    clip: float = 5.0
    balance: float = 0.5
    augment: bool = True
    repaint: bool = True
    others: float = 0.5
    angle_weight: float = 1.0
    segmentation: float = 0.5
    block_steps: int = 3_000
    block_batch: int = 256
    at_once: int | None = None
    validation_share: float = 0.05
    evaluate_every: int = 2000
    save_every: int = 100
    cache_gb: float = 4.0
    precision: str = "auto"
    device: str = "auto"
    initial: str | None = None
    seed: int = 0


TRAININGS = {
    "small": TrainingConfig(angle_weight=5.0),
    # Section 3.1: Adam, mini-batches of 32 sequences, base rate 5e-5.
    "paper": TrainingConfig(
        steps=75_000,
        batch=32,
        learning_rate=5e-5,
        warm_up=0,
        final_rate=1.0,
        balance=0.0,
        block_steps=0,
        repaint=False,
        others=0.0,
        segmentation=0.0,
        at_once=64,
    ),
}
