"""A second lesson while training: what stands where in the image.

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

from caldrive.perception.dataset.recolour import FREEDOM
from caldrive.perception.network.network import Network

STAGE = 3  # of the backbone, counted from 0: a cell of 16 pixels answers for four of 8, and sees 100 x 100 pixels
CELL = 8


class Segmentation(nn.Module):
    """Maps (N, C, h, w) of the backbone's fourth stage to logits (N, classes, 2 h, 2 w), a cell of 8 x 8 pixels each.

    What the pools cut off at the right and at the bottom of the image has no cell.
    """

    def __init__(self, n_channels: int) -> None:
        super().__init__()
        self.head = nn.Conv2d(n_channels, 4 * len(FREEDOM), 1)

    def forward(self, maps: Tensor) -> Tensor:
        return pixel_shuffle(self.head(maps), 2)


def segmentation_loss(logits: Tensor, semantics: NDArray[np.uint8], generator: Generator) -> Tensor:
    """Cross-entropy with the class of one pixel of each cell, drawn for each batch: in the mean the cell's shares.

    logits (N, classes, rows, columns); semantics (N, H, W): the class of each pixel.
    """
    y, x = torch.randint(CELL, (2,), generator=generator).tolist()
    height, width = (CELL * n for n in logits.shape[2:])
    target = torch.from_numpy(np.ascontiguousarray(semantics[:, y:height:CELL, x:width:CELL])).long()
    return cross_entropy(logits.float(), target.to(logits.device))


class Lessons(nn.Module):
    """The network and its second lesson as one call, which is what DistributedDataParallel looks after."""

    def __init__(self, network: Network, segmentation: Segmentation | None = None, at_once: int | None = None) -> None:
        super().__init__()
        self.network, self.segmentation, self.at_once = network, segmentation, at_once

    def forward(self, images: Tensor, index: Tensor, command: Tensor) -> dict[str, Tensor]:
        """Normalised images (N, 3, H, W), and where windows find theirs among them (B, T), to outputs (B * S, K); each
        image passes the backbone once. Under `segmentation` are the logits of that lesson."""
        features, maps = self._see(images)
        outputs: dict[str, Tensor] = self.network(features[index], command)
        if self.segmentation is not None:
            outputs["segmentation"] = self.segmentation(maps)
        return outputs

    def _see(self, images: Tensor) -> tuple[Tensor, Tensor]:
        """Features (N, F), and the maps of the stage that the second lesson looks at."""
        if self.at_once is None or len(images) <= self.at_once:
            maps = self.network.backbone.maps(images)
            return maps[-1].flatten(1), maps[STAGE]
        # Of each part only the outcome is kept, and what lies before it computed again for the gradient.
        shares = torch.split(images, self.at_once)
        parts = [checkpoint(self._see, share, use_reentrant=False) for share in shares]
        features, seen = (torch.cat(part) for part in zip(*parts, strict=True))
        return features, seen
