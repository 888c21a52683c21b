"""Domain randomisation of recorded images: each class of things gets other colours, by the semantic images.

A network that has seen one town only takes its paint for what matters: red sidewalks or grey ones, and a yellow gate
for a yellow car. What tells lanes, lights and signs apart keeps its colours. The semantic image is used in training
only, never when driving.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Generator, Tensor
from torch.nn.functional import interpolate

from caldrive.datatypes import Semantic
from caldrive.perception.dataset.config import RecolourConfig


class ClassRule(NamedTuple):
    """What may happen to the pixels of one class. freedom: how far its colours may change, 0 for not at all; covered:
    whether patches may cover it; shaded: whether light and shadows fall on it."""

    freedom: float
    covered: bool
    shaded: bool


RULES: Mapping[Semantic, ClassRule] = {
    Semantic.SKY: ClassRule(freedom=0.5, covered=True, shaded=False),
    Semantic.ROAD: ClassRule(freedom=0.5, covered=False, shaded=True),
    Semantic.LINE: ClassRule(freedom=0.2, covered=False, shaded=True),
    Semantic.SIDEWALK: ClassRule(freedom=1.0, covered=True, shaded=True),
    Semantic.GROUND: ClassRule(freedom=1.0, covered=True, shaded=True),
    Semantic.BUILDING: ClassRule(freedom=1.0, covered=True, shaded=True),
    Semantic.PLANT: ClassRule(freedom=0.8, covered=True, shaded=True),
    Semantic.FURNITURE: ClassRule(freedom=0.8, covered=True, shaded=True),
    Semantic.LIGHT: ClassRule(freedom=0.0, covered=False, shaded=False),
    Semantic.SIGN: ClassRule(freedom=0.0, covered=False, shaded=False),
    Semantic.VEHICLE: ClassRule(freedom=0.4, covered=False, shaded=False),
    Semantic.PERSON: ClassRule(freedom=0.4, covered=False, shaded=False),
}


def _by_class(value: Callable[[ClassRule], Any], dtype: Any) -> NDArray[Any]:
    """A value of each rule (K,), where the class of a pixel finds it."""
    table = np.zeros(len(Semantic), dtype)
    for kind, rule in RULES.items():
        table[kind] = value(rule)
    return table


FREEDOM = torch.from_numpy(_by_class(lambda rule: rule.freedom, np.float32))
COVERED = _by_class(lambda rule: rule.covered, bool)
SHADED = _by_class(lambda rule: rule.shaded, bool)
GRAIN_SIZES = (1, 2, 4, 8)  # pixels


def recolour(
    images: Tensor,
    semantics: NDArray[np.uint8],
    groups: Tensor,
    generator: Generator,
    config: RecolourConfig | None = None,
) -> Tensor:
    """Images (N, 3, H, W) by `to_float`, changed in place; semantics (N, H, W): the class of each pixel.

    groups (N,): frames of one number (from 0) get the same colours.
    """
    config = config or RecolourConfig()
    n = int(groups.max()) + 1
    rows = (torch.rand(n, generator=generator) < config.share)[groups].nonzero()[:, 0]
    own, grey, grain = _factors(n, config, generator)
    if not len(rows):
        return images
    seed = int(torch.randint(2**31, (1,), generator=generator))
    for row in rows.tolist():
        _patch(images[row], semantics[row], config.patches, np.random.default_rng((seed, int(groups[row]))))
        _shade(images[row], semantics[row], config.shadows, np.random.default_rng((seed, 1, int(groups[row]))))
    height, width = images.shape[2:]
    pixels = images.permute(0, 2, 3, 1).view(len(images), -1, 3)
    classes = torch.from_numpy(semantics.reshape(len(images), -1)).long()[rows]
    index = (classes + len(Semantic) * groups[rows, None]).view(-1)
    old = pixels[rows].view(-1, 3)
    new = own.view(-1, 3)[index].mul_(old).addcmul_(grey.view(-1, 3)[index], old.mean(dim=1, keepdim=True))
    noise = _noise(len(rows), height, width, generator).reshape(-1, 1)
    new.addcmul_(new, noise.mul_(grain.view(-1, 1)[index]))
    pixels[rows] = new.clamp_(0, 1).view(len(rows), -1, 3)
    return images


def _factors(n: int, config: RecolourConfig, generator: Generator) -> tuple[Tensor, Tensor, Tensor]:
    """For each of n groups and each class: factors of the colours, factors of the grey (n, K, 3), grain (n, K, 1)."""
    freedom, k = FREEDOM[:, None], len(Semantic)

    def uniform(*shape: int) -> Tensor:
        return torch.rand(n, *shape, generator=generator) * 2 - 1

    light = (config.light * freedom * uniform(k, 1)).exp()
    plain = config.plain * freedom * uniform(k, 1).abs()
    own, grey = (light * (1 + config.tint * freedom * uniform(k, 3)) for _ in range(2))
    return (1 - plain) * own, plain * grey, config.grain * freedom * uniform(k, 1).abs()


def _noise(n: int, height: int, width: int, generator: Generator) -> Tensor:
    """Noise (n, H * W, 1) of one grain size, mean 0 and deviation 1."""
    size = GRAIN_SIZES[int(torch.randint(len(GRAIN_SIZES), (1,), generator=generator))]
    small = torch.randn(n, 1, -(-height // size), -(-width // size), generator=generator)
    return interpolate(small, scale_factor=size)[..., :height, :width].reshape(n, -1, 1)


def _patch(image: Tensor, classes: NDArray[np.uint8], most: int, rng: np.random.Generator) -> None:
    """Rectangles of any colour on what stands beside the road: a yellow gate is neither a car nor a person."""
    height, width = image.shape[1:]
    for _ in range(int(rng.integers(0, most + 1))):
        h, w = (int(rng.integers(1, limit)) for limit in (height // 2 + 1, width // 4 + 1))
        y, x = int(rng.integers(height - h)), int(rng.integers(width - w))
        free = torch.from_numpy(COVERED[classes[y : y + h, x : x + w]])
        area = image[:, y : y + h, x : x + w]
        color = torch.from_numpy(rng.random((3, 1, 1), dtype=np.float32))
        area.copy_(torch.where(free, color, area))


def _shade(image: Tensor, classes: NDArray[np.uint8], most: int, rng: np.random.Generator) -> None:
    """Shadows and light of any warmth with straight edges, as a house's edge throws them: no lane ends there, and a
    strip of evening sun on a wall is no lamp."""
    y, x = np.ogrid[0 : image.shape[1], 0 : image.shape[2]]
    for _ in range(int(rng.integers(0, most + 1))):
        angle, through = rng.uniform(0, 2 * np.pi), rng.random(2) * image.shape[1:]
        distance = (y - through[0]) * np.sin(angle) + (x - through[1]) * np.cos(angle)  # from the edge, in pixels
        inside = (distance > 0) & (distance < rng.uniform(0.1, 2.0) * image.shape[2]) & SHADED[classes]
        light = np.exp(rng.uniform(-1.1, 0.5)) * (1 + rng.uniform(-0.3, 0.3, (3, 1, 1)))
        factor = np.where(inside, light, 1.0).astype(np.float32)
        image.mul_(torch.from_numpy(factor)).clamp_(max=1)
