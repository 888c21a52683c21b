"""The published augmentation of conditional imitation learning, with its probabilities.

As one of the authors posted them for the released agent (issue 1 of its repository): each change comes with a
probability of its own, the changes of a batch in random order. The paper's list has saturation, too, whose strength
nobody gives; none of them moves anything.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import torch
from torch import Generator, Tensor
from torch.nn.functional import conv2d, interpolate, pad

BLUR_RADIUS = 4  # pixels, nearly three of the largest deviations
HALF = 0.5  # of full brightness, around which contrast changes


def _uniform(n: int, low: float, high: float, generator: Generator) -> Tensor:
    return low + (high - low) * torch.rand(n, generator=generator)


def _values(n: int, low: float, high: float, by_channel: float, generator: Generator) -> Tensor:
    """A value (n, 3, 1, 1) for each image, or in so many of the cases one for each of its channels."""
    alike = _uniform(n, low, high, generator)[:, None].expand(n, 3)
    apart = low + (high - low) * torch.rand(n, 3, generator=generator)
    chosen = torch.where(torch.rand(n, 1, generator=generator) < by_channel, apart, alike)
    return chosen[:, :, None, None]


def _blur(images: Tensor, generator: Generator) -> Tensor:
    """Gaussian, of a standard deviation of 0 to 1.5 pixels."""
    offsets = torch.arange(-BLUR_RADIUS, BLUR_RADIUS + 1.0)
    deviation = _uniform(len(images), 0.0, 1.5, generator).clamp(min=0.01)
    taps = torch.exp(-(offsets**2) / (2 * deviation[:, None] ** 2))
    taps = (taps / taps.sum(dim=1, keepdim=True)).repeat_interleave(3, dim=0)[:, None]  # (N * 3, 1, taps)
    n, _, height, width = images.shape
    channels = images.reshape(1, n * 3, height, width)
    channels = pad(channels, (BLUR_RADIUS,) * 4, mode="replicate")
    channels = conv2d(channels, taps[:, :, :, None], groups=n * 3)
    return conv2d(channels, taps[:, :, None], groups=n * 3).reshape(n, 3, height, width)


def _noise(images: Tensor, generator: Generator) -> Tensor:
    """Additive Gaussian noise of a standard deviation up to 0.05 of 255, as posted for images in bytes, half the time
    another one in each channel."""
    n, _, height, width = images.shape
    deviation = _uniform(n, 0.0, 0.05 / 255, generator)[:, None, None, None]
    apart = torch.randn(images.shape, generator=generator)
    alike = torch.randn(n, 1, height, width, generator=generator)
    by_channel = torch.rand(n, 1, 1, 1, generator=generator) < 0.5
    return images + deviation * torch.where(by_channel, apart, alike)


def _dropped(images: Tensor, cells: tuple[int, int], generator: Generator) -> Tensor:
    """Images of which up to a tenth of so many cells are black, half the time in one channel each."""
    n = len(images)
    share = _uniform(n, 0.0, 0.1, generator)[:, None, None, None]
    apart = torch.rand(n, 3, *cells, generator=generator)
    by_channel = torch.rand(n, 1, 1, 1, generator=generator) < 0.5
    kept = (torch.where(by_channel, apart, apart[:, :1]) >= share).float()
    return images * interpolate(kept, size=images.shape[2:], mode="nearest")


def _pixels(images: Tensor, generator: Generator) -> Tensor:
    """Dropout of single pixels."""
    height, width = images.shape[2:]
    return _dropped(images, (height, width), generator)


def _patches(images: Tensor, generator: Generator) -> Tensor:
    """Coarse dropout: cells of as many as 8 to 20 % of the image's pixels a side."""
    share = float(_uniform(1, 0.08, 0.2, generator))
    height, width = images.shape[2:]
    return _dropped(images, (max(3, round(share * height)), max(3, round(share * width))), generator)


def _add(images: Tensor, generator: Generator) -> Tensor:
    return images + _values(len(images), -40 / 255, 40 / 255, 0.5, generator)


def _multiply(images: Tensor, generator: Generator) -> Tensor:
    return images * _values(len(images), 0.1, 2.5, 0.2, generator)


def _contrast(images: Tensor, generator: Generator) -> Tensor:
    return HALF + (images - HALF) * _values(len(images), 0.5, 1.5, 0.5, generator)


@dataclass(frozen=True)
class Change:
    """A row of the augmentation."""

    probability: float
    """That an image is changed so."""
    apply: Callable[[Tensor, Generator], Tensor]
    """To images (N, 3, H, W)."""


CHANGES = {
    "Gaussian blur": Change(0.09, _blur),
    "Gaussian noise": Change(0.09, _noise),
    "dropout of pixels": Change(0.3, _pixels),
    "dropout of patches": Change(0.3, _patches),
    "other brightness": Change(0.3, _add),
    "multiplied brightness": Change(0.4, _multiply),
    "other contrast": Change(0.09, _contrast),
}


def augment_as_published(images: Tensor, generator: Generator) -> Tensor:
    """Images (N, 3, H, W) in [0, 1], on the CPU, each with the changes that its chances give it; between two changes
    bytes end at black and white, as they do in the library that was used (imgaug)."""
    changed = images.clone()
    for number in torch.randperm(len(CHANGES), generator=generator).tolist():
        change = tuple(CHANGES.values())[number]
        chosen = (torch.rand(len(images), generator=generator) < change.probability).nonzero()[:, 0]
        if len(chosen):
            changed[chosen] = change.apply(changed[chosen], generator).clamp(0, 1)
    return changed
