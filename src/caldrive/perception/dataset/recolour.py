"""Towns in other colours: an augmentation that paints each class of things anew, by the semantic images of a recording.

A network that has seen one town only takes its paint for what matters: red sidewalks or grey ones, and a yellow gate
for a yellow car. What tells lanes, lights and signs apart keeps its colours. The semantic image is used in training
only, never when driving.
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
# What patches may cover: the sky, sidewalks, ground, buildings, plants and furniture.
COVERED = np.array((1, 0, 0, 1, 1, 1, 1, 1, 0, 0, 0, 0), bool)

# What light and shadows fall on: road, lines, sidewalks, ground, buildings, plants and furniture.
SHADED = np.array((0, 1, 1, 1, 1, 1, 1, 1, 0, 0, 0, 0), bool)


@dataclass(frozen=True)
class Repaint:
    """share: of the frames. tint: largest change of a channel's factor. light: largest change of a class's brightness,
    as a factor's logarithm. plain: largest share of one single colour in a class. grain: deviation of the noise on it.
    patches: most rectangles of any colour, with at most half the image's height and a quarter of its width. shadows:
    most shadows of houses that are not in the picture, or gaps of light between them.
    """

    share: float = 0.5
    tint: float = 0.35
    light: float = 0.5
    plain: float = 0.8
    grain: float = 0.12
    patches: int = 12
    shadows: int = 3


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


def _patch(images: Tensor, kinds: NDArray[np.uint8], rows: Tensor, groups: Tensor, most: int, seed: int) -> None:
    """Rectangles of any colour on what stands beside the road: a yellow gate is neither a car nor a person."""
    height, width = images.shape[2:]
    for row in rows.tolist():
        rng = np.random.default_rng((seed, int(groups[row])))
        for _ in range(int(rng.integers(0, most + 1))):
            h, w = (int(rng.integers(1, limit)) for limit in (height // 2 + 1, width // 4 + 1))
            y, x = int(rng.integers(height - h)), int(rng.integers(width - w))
            free = torch.from_numpy(COVERED[kinds[row, y : y + h, x : x + w]])
            area = images[row, :, y : y + h, x : x + w]
            color = torch.from_numpy(rng.random((3, 1, 1), dtype=np.float32))
            area.copy_(torch.where(free, color, area))


def _shade(images: Tensor, kinds: NDArray[np.uint8], rows: Tensor, groups: Tensor, most: int, seed: int) -> None:
    """Shadows and light of any warmth with straight edges, as a house's edge throws them: no lane ends there, and a
    strip of evening sun on a wall is no lamp."""
    y, x = np.mgrid[0 : images.shape[2], 0 : images.shape[3]].astype(np.float32)
    for row in rows.tolist():
        rng = np.random.default_rng((seed, 1, int(groups[row])))
        for _ in range(int(rng.integers(0, most + 1))):
            angle, through = rng.uniform(0, 2 * np.pi), rng.random(2) * images.shape[2:]
            beyond = (y - through[0]) * np.sin(angle) + (x - through[1]) * np.cos(angle)
            inside = (beyond > 0) & (beyond < rng.uniform(0.1, 2.0) * images.shape[3]) & SHADED[kinds[row]]
            light = np.exp(rng.uniform(-1.1, 0.5)) * (1 + rng.uniform(-0.3, 0.3, (3, 1, 1)))
            factor = np.where(inside, light, 1.0).astype(np.float32)
            images[row].mul_(torch.from_numpy(factor)).clamp_(max=1)


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
    seed = int(torch.randint(2**31, (1,), generator=generator))
    _patch(images, semantics, rows, groups, config.patches, seed)
    _shade(images, semantics, rows, groups, config.shadows, seed)
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
