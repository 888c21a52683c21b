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

from caldrive.perception.repaint import FREEDOM

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
