"""Settings of the segmentation network and of its training, as published and on all frames. No import here waits for
torch."""

from __future__ import annotations

import math
from dataclasses import dataclass

from caldrive.checks import require_within
from caldrive.perception.dataset.config import AugmentationConfig, RecolourConfig
from caldrive.perception.network.config import NetworkConfig
from caldrive.perception.training.config import LoopConfig


@dataclass(frozen=True)
class SegmentationConfig:
    """The network. The default is what ships."""

    image_width: int = 200
    """Width of the images in pixels."""
    image_height: int = 88
    """Height of the images in pixels."""
    width: float = 0.25
    """Channels of the convolutions as a share of VGG16's."""
    decoder: int = 24
    """Channels of the decoder."""
    junction_nodes: int = 64
    """Nodes of the layer before the junction's output."""

    def __post_init__(self) -> None:
        NetworkConfig(image_width=self.image_width, image_height=self.image_height, width=self.width)  # same limits
        if not 1 <= self.decoder <= 1024 or not 1 <= self.junction_nodes <= 10_000:
            raise ValueError(
                f"found a decoder of {self.decoder} channels and {self.junction_nodes} nodes, wanted 1 to 1024 and "
                "1 to 10000"
            )

    @property
    def image_size(self) -> tuple[int, int]:
        """(height, width) of the images in pixels."""
        return self.image_height, self.image_width

    @property
    def class_size(self) -> tuple[int, int]:
        """(height, width) of the classes: half the image's."""
        return self.image_height // 2, self.image_width // 2


SEGMENTATION_NETWORK = SegmentationConfig()


@dataclass(frozen=True)
class PipelineConfig(LoopConfig):
    """How the network learns. The paper's segmentation had 2,500 images and no augmentation, its junction classifier
    500; here both learn from the same frames."""

    frames: int | None = None
    """Frames to learn from, spread evenly over the recording; without it all."""
    junction_weight: float = 0.2
    """What the junction's cross-entropy counts beside that of the pixels."""

    def __post_init__(self) -> None:
        super().__post_init__()
        require_within("--junction-weight", self.junction_weight, 0.0, math.inf, 0.2)
        if self.frames is not None:
            require_within("--frames", self.frames, 1, 10**9, 2500)

    @property
    def wants_semantics(self) -> bool:
        """They are what is learnt."""
        return True


PIPELINE_TRAININGS = {
    "published": PipelineConfig(
        frames=2500, augmentation=AugmentationConfig(enabled=False), recolour=RecolourConfig(enabled=False)
    ),
    "all-frames": PipelineConfig(),  # with CAL's augmentation
}
