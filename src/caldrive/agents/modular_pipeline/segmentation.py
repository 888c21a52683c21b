"""The network of the modular pipeline: five classes of pixels, and whether a junction is near; and what it learns by.

    image -> CAL's convolutions, five stages -+-> decoder -> five classes at half the image's size
                                              +-> 64 -> junction or not

The paper segments with RefineNet on ResNet, and has an AlexNet of its own for junctions, both too large for a CPU at
the wheel. Here both share CAL's small backbone. The decoder is RefineNet's idea at that size: from the coarsest stage
to the finest, what is known so far is doubled in size, the finer stage is added, and a convolution refines the sum.
"""

from __future__ import annotations

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.nn.functional import avg_pool2d, binary_cross_entropy_with_logits, cross_entropy, interpolate, one_hot

from caldrive.agents.modular_pipeline.config import SegmentationConfig
from caldrive.agents.modular_pipeline.scene import JUNCTION_AHEAD, SCENE_CLASS, SceneClass
from caldrive.perception.network.backbone import Backbone
from caldrive.recordings.reader import Episode
from caldrive.recordings.writer import EpisodeError

GAP = 1.0  # s between two frames of a stream from which the way between them is unknown
STANDING = 0.3  # m/s, below which the car stands
CLASS_WEIGHTS = {SceneClass.LANE_MARKING: 2.0, SceneClass.DYNAMIC: 2.0}  # thin or rare; 1 for the others


class Refinement(nn.Module):
    """A step of the decoder: what is known so far (N, D, h, w) and a finer stage (N, C, H, W) to (N, D, H, W)."""

    def __init__(self, n_stage: int, n_decoder: int) -> None:
        super().__init__()
        self.lateral = nn.Conv2d(n_stage, n_decoder, 1)
        self.refine = nn.Conv2d(n_decoder, n_decoder, 3, padding=1)
        self.norm = nn.BatchNorm2d(n_decoder)

    def forward(self, known: Tensor, stage: Tensor) -> Tensor:
        """The refined sum."""
        larger = interpolate(known, size=stage.shape[2:], mode="nearest")
        refined: Tensor = self.norm(self.refine(larger + self.lateral(stage)))
        return refined.relu_()


class SegmentationNetwork(nn.Module):
    """Normalised images (N, 3, H, W) to the logits of the classes (N, 5, H // 2, W // 2) and of the junction (N,)."""

    def __init__(self, config: SegmentationConfig) -> None:
        super().__init__()
        self.config = config
        self.backbone = Backbone(config.width, batch_norm=True)
        *finer, coarsest = self.backbone.channels
        self.coarsest = nn.Conv2d(coarsest, config.decoder, 1)
        self.refinements = nn.ModuleList(Refinement(n, config.decoder) for n in reversed(finer))
        self.classes = nn.Conv2d(config.decoder, len(SceneClass), 1)
        n_features = self.backbone.n_features(*config.image_size)
        self.junction = nn.Sequential(
            nn.Linear(n_features, config.junction_nodes), nn.ReLU(), nn.Linear(config.junction_nodes, 1)
        )

    def forward(self, images: Tensor) -> tuple[Tensor, Tensor]:
        """Logits of the classes and of the junction."""
        *finer, coarsest = self.backbone.maps(images)
        known = self.coarsest(coarsest)
        for refinement, stage in zip(self.refinements, reversed(finer), strict=True):
            known = refinement(known, stage)
        return self.classes(known), self.junction(coarsest.flatten(1))[:, 0]


def class_shares(semantics: Tensor) -> Tensor:
    """Semantic images (N, H, W) in bytes to the share of each class (N, 5, H // 2, W // 2) in squares of 2 x 2 pixels:
    a line one pixel wide stays visible."""
    numbers = torch.from_numpy(SCENE_CLASS).to(semantics.device)[semantics.long()]
    return avg_pool2d(one_hot(numbers.long(), len(SceneClass)).movedim(-1, 1).float(), 2)


def segmentation_loss(logits: Tensor, semantics: Tensor) -> Tensor:
    """Cross-entropy of logits (N, 5, H // 2, W // 2) with the shares of the classes in semantic images (N, H, W)."""
    weights = torch.tensor([CLASS_WEIGHTS.get(kind, 1.0) for kind in SceneClass], device=logits.device)
    return cross_entropy(logits.float(), class_shares(semantics), weight=weights)


def junction_loss(logits: Tensor, labels: Tensor) -> Tensor:
    """Cross-entropy of logits (N,) with labels (N,): 0, 1, or NaN for those that nobody knows, which count nothing."""
    known = labels.isfinite()
    if not known.any():
        return logits.float().sum() * 0.0
    return binary_cross_entropy_with_logits(logits.float()[known], labels[known].float())


def junction_labels(episode: Episode, ahead: float = JUNCTION_AHEAD) -> NDArray[np.float64]:
    """Whether the car is in a junction at each row (N,), or comes into one within so many m: 1 or 0; NaN where the
    recording ends before that is known."""
    labels = np.full(len(episode), np.nan)
    columns = episode.columns
    for camera in np.unique(columns["camera"]):
        rows = np.flatnonzero(columns["camera"] == camera)
        labels[rows] = _labels_along(
            columns["junction"][rows].astype(bool), columns["time"][rows], columns["speed"][rows], ahead
        )
    return labels


def _labels_along(
    inside: NDArray[np.bool_], time: NDArray[np.float64], speed: NDArray[np.float64], ahead: float
) -> NDArray[np.float64]:
    """The labels (N,) of one camera's rows. Where rows are missing for long, the car is taken to have driven far,
    unless it stands before and after: of those that stand only some rows are kept."""
    gaps, moves = np.diff(time), np.maximum(speed[1:], speed[:-1]) > STANDING
    way = np.where((gaps > GAP) & moves, np.inf, (speed[1:] + speed[:-1]) / 2 * gaps)
    labels = np.full(len(inside), np.nan)
    to_junction, known = np.inf, 0.0  # m from a row to the next junction, and of way that is known
    for k in range(len(inside) - 1, -1, -1):
        if k < len(way):
            is_broken = not np.isfinite(way[k])
            to_junction = np.inf if is_broken else to_junction + way[k]
            known = 0.0 if is_broken else known + way[k]
        if inside[k]:
            to_junction = 0.0
        if to_junction <= ahead:
            labels[k] = 1.0
        elif known >= ahead:
            labels[k] = 0.0
    return labels


def require_semantics(episodes: list[Episode] | tuple[Episode, ...]) -> None:
    """Raises EpisodeError where a recording has no semantic images, without which nothing can be learnt here."""
    for episode in episodes:
        if episode.semantics is None:
            raise EpisodeError(
                f"found no semantic images in {episode.path}, wanted them for the agent mp: record with "
                "caldrive collect --semantic"
            )
