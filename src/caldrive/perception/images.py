"""Images on their way into the network: the check of a camera's image, and normalisation."""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from caldrive.interfaces import BadImage

MEAN = (0.485, 0.456, 0.406)  # of ImageNet, RGB, as shares of full brightness
DEVIATION = (0.229, 0.224, 0.225)

DARK_LEVEL = 3  # a byte; a black image has a little noise
LIT_SHARE = 0.01  # of a working camera's image at least this share is brighter than that, even by night


def check_image(image: Any, size: tuple[int, int]) -> None:
    """Raises BadImage where an image is no picture (H, W, 3) in bytes of this size (H, W), or is black."""
    wanted = (*size, 3)
    if not isinstance(image, np.ndarray):
        raise BadImage(f"the image is {image}, the network takes {wanted} of uint8: brake, and look at the camera")
    if image.shape != wanted or image.dtype != np.uint8:
        raise BadImage(
            f"the image is {image.shape} of {image.dtype}, the network takes {wanted} of uint8: set the camera so"
        )
    if np.count_nonzero(image > DARK_LEVEL) < LIT_SHARE * image.size:
        raise BadImage("the image is black: brake, and look at the camera")


def to_float(images: NDArray[np.uint8]) -> Tensor:
    """Images (N, H, W, 3) in bytes as (N, 3, H, W) in [0, 1], channels last in memory."""
    return torch.from_numpy(np.ascontiguousarray(images)).permute(0, 3, 1, 2).float().div_(255)


def interleaved_rows(images: Tensor) -> Tensor:
    """A view of images (N, 3, H, W) as rows of interleaved colours (N, H, W * 3): ten times faster to walk than by
    channel."""
    return images.permute(0, 2, 3, 1).view(len(images), images.shape[2], -1)


def gain_and_shift() -> tuple[tuple[float, ...], tuple[float, ...]]:
    """What a byte is multiplied by, and what is added then, to come to ImageNet's mean 0 and deviation 1; RGB."""
    gain = tuple(1 / (255 * deviation) for deviation in DEVIATION)
    return gain, tuple(-mean / deviation for mean, deviation in zip(MEAN, DEVIATION, strict=True))


def normalise(images: Tensor) -> Tensor:
    """Images (N, 3, H, W) by `to_float` to ImageNet's mean 0 and deviation 1, in place."""
    of_bytes, shift = (torch.tensor([values]) for values in gain_and_shift())
    gain = 255 * of_bytes
    width = images.shape[3]
    interleaved_rows(images).mul_(gain.repeat(1, width)[:, None]).add_(shift.repeat(1, width)[:, None])
    return images
