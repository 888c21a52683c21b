"""The paper's augmentations (section 3.1): colour, saturation, contrast, brightness, blur, salt and pepper.

Never a flip: it would turn left into right. All random numbers come from one generator, so the order of the calls here
decides what a seed gives.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Generator, Tensor

from caldrive.perception.dataset.config import AugmentationConfig, RecolourConfig
from caldrive.perception.dataset.recolour import recolour
from caldrive.perception.images import interleaved_rows, to_float

INVISIBLE_BLUR = 0.2  # pixels of deviation, up to which a blur changes nothing


class Looks(Protocol):
    """Settings of what happens to a training's images."""

    @property
    def augmentation(self) -> AugmentationConfig:
        """Of whole images."""
        ...

    @property
    def recolour(self) -> RecolourConfig:
        """Of each class of things."""
        ...


def augment(
    images: Tensor, generator: Generator, groups: Tensor | None = None, config: AugmentationConfig | None = None
) -> Tensor:
    """Images with other colours, saturation, contrast, brightness and sharpness, and with salt and pepper.

    images (N, 3, H, W): as from `to_float`, in [0, 1] and on the CPU.
    groups (N,): frames of one number (from 0) change alike, so that no sequence flickers; default: each by itself.
    """
    config = config or AugmentationConfig()
    groups = torch.arange(len(images)) if groups is None else groups
    for change in (_light, _blur, _salt_and_pepper):
        images = change(images, groups, config, generator)
    return images


def augmented(
    images: NDArray[np.uint8], semantics: NDArray[np.uint8] | None, group: Tensor, generator: Generator, config: Looks
) -> Tensor:
    """A batch's images (N, H, W, 3) as (N, 3, H, W) in [0, 1], recoloured where there are semantic images (N, H, W),
    and augmented. group (N,): as in `augment`."""
    changed = to_float(images)
    if config.recolour.enabled and semantics is not None:
        changed = recolour(changed, semantics, group, generator, config.recolour)
    if config.augmentation.enabled:
        changed = augment(changed, generator, group, config.augmentation)
    return changed


def _uniform(n: int, limit: float, share: float, generator: Generator) -> Tensor:
    """n values in [-limit, limit], all but a share of them 0."""
    on = torch.rand(n, generator=generator) < share
    return (torch.rand(n, generator=generator) * 2 - 1) * limit * on


def _light(images: Tensor, groups: Tensor, config: AugmentationConfig, generator: Generator) -> Tensor:
    """Colour, saturation, contrast and brightness as one matrix and one shift for each frame."""
    n = int(groups.max()) + 1
    color = torch.stack([1 + _uniform(n, config.color, config.share, generator) for _ in range(3)], dim=1)
    saturation = 1 + _uniform(n, config.saturation, config.share, generator)[:, None, None]
    contrast = 1 + _uniform(n, config.contrast, config.share, generator)
    brightness = _uniform(n, config.brightness, config.share, generator)
    mean = images[:, :, ::4, ::4].mean(dim=(1, 2, 3))  # every fourth pixel will do
    mixed = saturation * torch.eye(3) + (1 - saturation) / 3  # each colour drawn towards or away from the pixel's grey
    matrix = (mixed * (color * contrast[:, None])[:, None])[groups]  # (N, 3, 3), from columns to columns
    shift = brightness[groups] + (1 - contrast[groups]) * mean
    pixels = images.permute(0, 2, 3, 1).view(len(images), -1, 3)
    lit = torch.baddbmm(shift[:, None, None].expand(-1, 1, 3), pixels, matrix).clamp_(0, 1)
    return lit.view(len(images), *images.shape[2:], 3).permute(0, 3, 1, 2)


def _weighted_sum(rows: Tensor, dim: int, stride: int, taps: Tensor) -> Tensor:
    """Weighted sum of rows (N, H, W * 3) and their neighbours along a dimension; edges are repeated."""
    size = rows.shape[dim]
    first, last = rows.narrow(dim, 0, stride), rows.narrow(dim, size - stride, stride)
    padded = torch.cat((first, first, rows, last, last), dim)
    return torch.stack([tap * padded.narrow(dim, i * stride, size) for i, tap in enumerate(taps)]).sum(0)


def _gaussian(images: Tensor, deviation: float) -> Tensor:
    """Gaussian blur of images (N, 3, H, W) with five taps a direction."""
    taps = torch.exp(-(torch.arange(-2, 3) ** 2) / (2 * deviation**2))
    taps = taps / taps.sum()
    rows = _weighted_sum(interleaved_rows(images), dim=1, stride=1, taps=taps)
    rows = _weighted_sum(rows, dim=2, stride=3, taps=taps)
    return rows.view(len(images), *images.shape[2:], 3).permute(0, 3, 1, 2)


def _blur(images: Tensor, groups: Tensor, config: AugmentationConfig, generator: Generator) -> Tensor:
    deviations = _uniform(int(groups.max()) + 1, config.blur, config.rare_share, generator).abs()
    for group, deviation in enumerate(deviations):
        rows = (groups == group).nonzero()[:, 0]
        if deviation > INVISIBLE_BLUR and len(rows):
            blurred = _gaussian(images[rows].contiguous(memory_format=torch.channels_last), float(deviation))
            images[rows] = blurred
    return images


def _salt_and_pepper(images: Tensor, groups: Tensor, config: AugmentationConfig, generator: Generator) -> Tensor:
    noise = _uniform(int(groups.max()) + 1, config.noise, config.rare_share, generator).abs()[groups]
    for row in noise.nonzero()[:, 0].tolist():
        chance = torch.rand(images.shape[2:], generator=generator)
        images[row, :, chance < noise[row] / 2] = 0.0
        images[row, :, chance > 1 - noise[row] / 2] = 1.0
    return images
