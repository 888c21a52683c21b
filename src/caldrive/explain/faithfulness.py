"""Whether attention is where the thing is, and whether the network needs what it looks at: numbers beside the pictures.

* Pointing game and energy (Zhang et al. 2018; Wang et al. 2020): the recording's semantic images say where a thing is.
* Deletion and insertion (RISE, Petsiuk et al. 2018), beside a random map and one that always looks at the middle.
* Cascading randomisation (Adebayo et al. 2018): a map that stays as it is while weights and norms are replaced, from
  the last layer to the first, shows edges and not what was learnt.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import torch
from numpy.typing import NDArray
from scipy.ndimage import binary_dilation, gaussian_filter
from scipy.stats import spearmanr
from torch import nn

from caldrive.datatypes import Image, Semantic
from caldrive.explain.activation_maps import Attention, Map, Question, ask, upsampled
from caldrive.perception.network.network import Network

Mask = NDArray[np.bool_]
Score = Callable[[Sequence[Image]], float]

# What each affordance is about, as classes of pixels.
ABOUT = {
    "hazard_stop": (Semantic.PERSON, Semantic.VEHICLE), "red_light": (Semantic.LIGHT,), "speed_sign": (Semantic.SIGN,),
    "vehicle_distance": (Semantic.VEHICLE,), "relative_angle": (Semantic.ROAD, Semantic.LINE),
    "center_distance": (Semantic.ROAD, Semantic.LINE),
}  # fmt: skip
TOLERANCE = 0.03  # of an image's width: the usual 15 pixels of 500
STEPS = 16  # of a deletion or an insertion
LEARNT = (nn.Linear, nn.Conv2d, nn.GRU, nn.LSTM, nn.BatchNorm1d, nn.BatchNorm2d, nn.LayerNorm)
BLUR = 8.0  # pixels, standard deviation of what takes a deleted place


def about(affordance: str, semantics: NDArray[np.uint8]) -> Mask:
    """Where in a semantic image (H, W) the thing is that an affordance is about."""
    return np.isin(semantics, ABOUT[affordance])


def points_at(one: Map, mask: Mask) -> bool:
    """Pointing game: whether the place of most attention is on the thing, or nearly. one: at the size of the mask."""
    near = binary_dilation(mask, iterations=round(TOLERANCE * mask.shape[1]))
    return bool(near[np.unravel_index(np.abs(one).argmax(), one.shape)])


def energy_inside(one: Map, mask: Mask) -> float:
    """The share of all attention that is on the thing, in [0, 1]."""
    strength = np.abs(one)
    return float(strength[mask].sum() / max(strength.sum(), 1e-12))


@dataclass(frozen=True)
class Curve:
    """Means of what a network says while an image is deleted or inserted place by place: the probability of the class,
    or of a value how near it is to the first, in [0, 1]."""

    deletion: float
    """Low where the map found what the network needs."""
    insertion: float
    """High where it did."""


def curve(images: Sequence[Image], maps: Sequence[Map], score: Score) -> Curve:
    """Deletes the places of most attention first, and puts them back first. images, maps: of each frame, of one size;
    score: what the network says of images."""
    blurred = [_blurred(image) for image in images]
    order = [np.argsort(np.argsort(-np.abs(one), axis=None)).reshape(one.shape) / one.size for one in maps]
    deletion, insertion = list[float](), list[float]()
    for share in (np.arange(STEPS) + 0.5) / STEPS:
        first = [ranks[..., None] < share for ranks in order]
        deletion.append(score([np.where(m, b, i) for m, b, i in zip(first, blurred, images, strict=True)]))
        insertion.append(score([np.where(m, i, b) for m, b, i in zip(first, blurred, images, strict=True)]))
    return Curve(float(np.mean(deletion)), float(np.mean(insertion)))


def _blurred(image: Image) -> Image:
    return np.asarray(gaussian_filter(image, (BLUR, BLUR, 0)))


def random_map(like: Map, size: tuple[int, int], rng: np.random.Generator) -> Map:
    """A map (H, W) that knows nothing, of as many places (h, w) as a real one."""
    return upsampled(rng.random(like.shape).astype(np.float32), size)


def centred_map(size: tuple[int, int]) -> Map:
    """A map that always looks at the middle."""
    y, x = (np.linspace(-1, 1, n)[:, None] for n in size)
    result: Map = np.exp(-(y**2 + x.T**2) / 0.5).astype(np.float32)
    return result


def score_of(network: Network, question: Question, images: Sequence[Image]) -> Score:
    """What a network says of changed images, in [0, 1]: the probability of the class that it sees in these; of a value,
    how near it stays to what it is, 0 where it is as far as in the blurred images or farther."""
    before = ask(network, question, images)
    if before.probability is not None:
        same = replace(question, label=question.spec.classes[before.target])
        return lambda changed: ask(network, same, changed).probability or 0.0
    blurred = [_blurred(image) for image in images]
    farthest = max(abs(ask(network, question, blurred).value - before.value), 1e-9)
    return lambda changed: 1.0 - min(1.0, abs(ask(network, question, changed).value - before.value) / farthest)


def randomised(network: Network, affordance: str, stages: int, seed: int) -> Network:
    """A copy whose block of an affordance is as before any training, with new weights and unused norms, and so many of
    the last stages of its backbone."""
    other = copy.deepcopy(network)
    convolutions, norms = list(other.backbone.stages), list(other.backbone.norms)
    first = len(convolutions) - stages
    parts: list[nn.Module] = [other.task_blocks()[affordance], *convolutions[first:], *norms[first:]]
    with torch.random.fork_rng([]):
        torch.manual_seed(seed)
        for layer in (layer for part in parts for layer in part.modules()):
            if isinstance(layer, LEARNT):
                layer.reset_parameters()
    return other


def similarity(one: Attention, other: Attention) -> float:
    """Spearman's rank correlation of two maps' places, in [-1, 1]; 0 where one of them is the same everywhere."""
    values = np.ravel(one.now), np.ravel(other.now)
    if any(np.ptp(value) == 0 for value in values):
        return 0.0
    return float(spearmanr(*values).statistic)
