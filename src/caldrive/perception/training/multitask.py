"""The network as it is trained: with an auxiliary segmentation head, and with gradient checkpointing.

Six numbers say little about an image; the class of each of its places says which edge is the lane's and which one a
shadow's. The head is thrown away after the training: the network that drives is the same with and without it.
"""

from __future__ import annotations

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Generator, Tensor, nn
from torch.nn.functional import cross_entropy, pixel_shuffle
from torch.utils.checkpoint import checkpoint

from caldrive.datatypes import Semantic
from caldrive.perception.network.network import Network

# Of the backbone, counted from 0. A place of its maps stands for 16 x 16 pixels, which are four cells, and sees about
# 100 x 100 pixels.
SEGMENTED_STAGE = 3
CELL = 8  # pixels a side
SEGMENTATION = "segmentation"  # the name of its logits among the outputs


class SegmentationHead(nn.Module):
    """Maps (N, C, h, w) of the backbone's fourth stage to logits (N, classes, 2 h, 2 w), a cell of 8 x 8 pixels each.

    What the pools cut off at the right and at the bottom of the image has no cell.
    """

    def __init__(self, n_channels: int) -> None:
        super().__init__()
        self.head = nn.Conv2d(n_channels, 4 * len(Semantic), 1)

    def forward(self, maps: Tensor) -> Tensor:
        """Maps (N, C, h, w) to logits (N, classes, 2 h, 2 w)."""
        return pixel_shuffle(self.head(maps), 2)


def segmentation_loss(logits: Tensor, semantics: NDArray[np.uint8], generator: Generator) -> Tensor:
    """Cross-entropy with the class of one pixel of each cell, drawn for each batch: in the mean the cell's shares.

    logits (N, classes, rows, columns); semantics (N, H, W): the class of each pixel.
    """
    y, x = torch.randint(CELL, (2,), generator=generator).tolist()
    height, width = (CELL * n for n in logits.shape[2:])
    target = torch.from_numpy(np.ascontiguousarray(semantics[:, y:height:CELL, x:width:CELL])).long()
    return cross_entropy(logits.float(), target.to(logits.device))


class MultiTaskModel(nn.Module):
    """The network and its segmentation head as one call, which is what DistributedDataParallel looks after.

    chunk: images that pass the backbone together, 0 for all. Of each chunk only the result is kept, and what lies
    before it is computed again for the gradient (gradient checkpointing).
    """

    def __init__(self, network: Network, segmentation: SegmentationHead | None = None, chunk: int = 0) -> None:
        super().__init__()
        self.network, self.segmentation, self.chunk = network, segmentation, chunk

    def forward(self, images: Tensor, index: Tensor, command: Tensor) -> dict[str, Tensor]:
        """Normalised images (N, 3, H, W), and where windows find theirs among them (B, T), to outputs (B * S, K); each
        image passes the backbone once. Under SEGMENTATION are the logits of the head."""
        features, maps = self._backbone(images)
        outputs: dict[str, Tensor] = self.network(features[index], command)
        if self.segmentation is not None:
            outputs[SEGMENTATION] = self.segmentation(maps)
        return outputs

    def _backbone(self, images: Tensor) -> tuple[Tensor, Tensor]:
        """Features (N, F), and the maps of the stage that the head looks at."""
        if not self.chunk or len(images) <= self.chunk:
            stages = self.network.backbone.maps(images)
            return stages[-1].flatten(1), stages[SEGMENTED_STAGE]
        chunks = torch.split(images, self.chunk)
        parts = [checkpoint(self._backbone, chunk, use_reentrant=False) for chunk in chunks]
        features, maps = (torch.cat(part) for part in zip(*parts, strict=True))
        return features, maps
