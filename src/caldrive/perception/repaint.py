"""Towns in other colours: an augmentation that paints each class of things anew, by the semantic images of a recording.

A network that has seen one town only takes its paint for what matters: red sidewalks or grey ones. What tells lanes,
lights and signs apart keeps its colours. The semantic image is used in training only, never when driving.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Generator, Tensor
from torch.nn.functional import interpolate

# How far each class may change, by its number in world/semantics.py: sky, road, line, sidewalk, ground, building,
# plant, furniture, light, sign, vehicle, person.
FREEDOM = (0.5, 0.5, 0.2, 1.0, 1.0, 1.0, 0.8, 0.8, 0.0, 0.0, 0.4, 0.4)
SCALES = (1, 2, 4, 8)  # pixels of a grain


@dataclass(frozen=True)
class Repaint:
    """share: of the frames. tint: largest change of a channel's factor. light: largest change of a class's brightness,
    as a factor's logarithm. plain: largest share of one single colour in a class. grain: deviation of the noise on it.
    """

    share: float = 0.5
    tint: float = 0.35
    light: float = 0.5
    plain: float = 0.8
    grain: float = 0.12


def _tables(n: int, config: Repaint, generator: Generator) -> tuple[Tensor, Tensor, Tensor]:
    """For each of n pictures and each class: factors of the colours, factors of the grey (n, K, 3), grain (n, K, 1)."""
    freedom = torch.tensor(FREEDOM)[:, None]
    k = len(FREEDOM)

    def uniform(*shape: int) -> Tensor:
        return torch.rand(n, *shape, generator=generator) * 2 - 1

    light = (config.light * freedom * uniform(k, 1)).exp()
    plain = config.plain * freedom * uniform(k, 1).abs()
    own, grey = (light * (1 + config.tint * freedom * uniform(k, 3)) for _ in range(2))
    return (1 - plain) * own, plain * grey, config.grain * freedom * uniform(k, 1).abs()


def _grains(n: int, height: int, width: int, generator: Generator) -> Tensor:
    """Noise (n, H * W, 1) of one grain size, mean 0 and deviation 1."""
    scale = SCALES[int(torch.randint(len(SCALES), (1,), generator=generator))]
    small = torch.randn(n, 1, -(-height // scale), -(-width // scale), generator=generator)
    return interpolate(small, scale_factor=scale)[..., :height, :width].reshape(n, -1, 1)


def repaint(
    images: Tensor, semantics: NDArray[np.uint8], groups: Tensor, generator: Generator, config: Repaint | None = None
) -> Tensor:
    """Images (N, 3, H, W) by `to_float`, changed in place; semantics (N, H, W): the class of each pixel.

    groups (N,): frames of one number (from 0) are painted alike.
    """
    config = config or Repaint()
    n = int(groups.max()) + 1
    rows = (torch.rand(n, generator=generator) < config.share)[groups].nonzero()[:, 0]
    own, grey, grain = _tables(n, config, generator)
    if not len(rows):
        return images
    height, width = images.shape[2:]
    pixels = images.permute(0, 2, 3, 1).view(len(images), -1, 3)
    kinds = torch.from_numpy(semantics.reshape(len(images), -1)).long()[rows]
    index = (kinds + len(FREEDOM) * groups[rows, None]).view(-1)
    old = pixels[rows].view(-1, 3)
    new = own.view(-1, 3)[index].mul_(old).addcmul_(grey.view(-1, 3)[index], old.mean(dim=1, keepdim=True))
    noise = _grains(len(rows), height, width, generator).reshape(-1, 1)
    new.addcmul_(new, noise.mul_(grain.view(-1, 1)[index]))
    pixels[rows] = new.clamp_(0, 1).view(len(rows), -1, 3)
    return images
