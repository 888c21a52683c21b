"""The training of the segmentation network: cross-entropy of pixels and of the junction, on the same frames."""

from __future__ import annotations

import copy
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Generator, Tensor, nn

from caldrive.agents.modular_pipeline.checkpoint import SegmentationInfo, save_segmentation
from caldrive.agents.modular_pipeline.config import PipelineConfig, SegmentationConfig
from caldrive.agents.modular_pipeline.scene import SceneClass
from caldrive.agents.modular_pipeline.segmentation import (
    SegmentationNetwork,
    class_shares,
    junction_labels,
    junction_loss,
    require_semantics,
    segmentation_loss,
)
from caldrive.perception.dataset.augmentation import augmented
from caldrive.perception.dataset.frames import Frames, Ids
from caldrive.perception.dataset.sampler import weighted
from caldrive.perception.images import normalise, to_float
from caldrive.perception.inference.engines import autocast
from caldrive.perception.network.calibration import input_ranges
from caldrive.perception.network.tensor_file import round_to_half
from caldrive.perception.training.distributed import join_process_group
from caldrive.perception.training.folder import TrainingFolder
from caldrive.perception.training.loop import Stop, finish_as_it_is, never, read_frames, run_training
from caldrive.progress import Progress, silent
from caldrive.recordings.folder import episode_paths

FRAMES_A_PASS = 64
RANGE_FRAMES = 256  # whose images say what enters a convolution


def train_pipeline(
    config: PipelineConfig,
    data: Path,
    out: Path,
    network: SegmentationConfig,
    progress: Progress = silent,
    stop: Stop = never,
) -> Path:
    """Train a network on the episodes in `data`, and return the finished one's path, `out`/model.safetensors.

    `loop.run_training` says what lies in `out`. Raises ValueError for settings or data that cannot be, and where
    another process works in `out`.
    """
    group = join_process_group(config.device, config.batch)
    episode_paths(data)  # without one, no folder is made

    def make_learner() -> PipelineLearner:
        frames = read_frames(config, network.image_size, data, semantic_validation=True)
        return start(config, network, frames.training, frames.validation, group.device)

    return run_training(make_learner, out, group, progress, stop)


@dataclass(frozen=True)
class JunctionSampler:
    """Draws frames, those near a junction as often as the others where balance is 1, evenly where it is 0. What step k
    draws depends on (seed, k) only."""

    ids: Ids
    cumulative: NDArray[np.float64]
    seed: int

    def draw(self, step: int, n: int) -> Ids:
        """n of the frames."""
        return weighted(self.ids, self.cumulative, np.random.default_rng((self.seed, step)).random(n))


def sampler_of(labels: NDArray[np.float64], config: PipelineConfig) -> JunctionSampler:
    """The sampler of frames with these labels (N,), of which config.frames are taken."""
    n = len(labels)
    ids = np.unique(np.linspace(0, n - 1, min(n, config.frames or n)).round().astype(np.int64))
    kinds = np.nan_to_num(labels[ids], nan=0.0).astype(np.int64)  # unknown ones are mostly far from junctions
    weights = (1 / np.bincount(kinds)[kinds]) ** config.balance
    return JunctionSampler(ids, np.cumsum(weights), config.seed)


@dataclass
class PipelineLearner:
    """The network of the modular pipeline (`run.Learner`). labels, validation_labels: by `junction_labels`."""

    config: PipelineConfig
    model: SegmentationNetwork
    training: Frames
    validation: Frames
    labels: Tensor
    validation_labels: Tensor
    sampler: JunctionSampler
    device: str
    figures: tuple[str, ...] = ("loss", "junction/accuracy", *(f"iou/{kind.name.lower()}" for kind in SceneClass))

    @property
    def steps(self) -> int:
        """All of them: there is no second stage."""
        return self.config.steps

    @property
    def network_settings(self) -> dict[str, Any]:
        """What the network is built from."""
        return asdict(self.model.config)

    @property
    def data_digest(self) -> str:
        """Tells the frames that it learns from from others."""
        return self.training.digest

    def loss(self, step: int, share: slice, forward: nn.Module, generator: Generator) -> Tensor:
        """The loss of a step's frames."""
        ids = self.sampler.draw(step, self.config.batch)[share]
        semantics = _semantics(self.training, ids)
        images = augmented(self.training.images(ids), semantics, torch.arange(len(ids)), generator, self.config)
        with autocast(self.config.precision, self.device):
            classes, junction = forward(normalise(images).to(self.device))
        return self._loss(classes, junction, semantics, self.labels[ids])

    def _loss(self, classes: Tensor, junction: Tensor, semantics: NDArray[np.uint8], labels: Tensor) -> Tensor:
        pixels = segmentation_loss(classes, torch.from_numpy(semantics).to(self.device))
        return pixels + self.config.junction_weight * junction_loss(junction, labels.to(self.device))

    def validate(self, path: Path) -> dict[str, float]:
        """Writes the network as it is, with its validation's figures, and returns them."""
        network = copy.deepcopy(self.model).eval()
        round_to_half(network)
        metrics = self._measure(network)
        data = {
            "train_frames": len(self.sampler.ids), "validation_frames": len(self.validation),
            "validation_episodes": sorted({episode.key for episode in self.validation.episodes}),
        }  # fmt: skip
        info = SegmentationInfo(network.config, data, metrics, asdict(self.config), self._ranges(network))
        save_segmentation(path, network, info)
        return metrics

    @torch.inference_mode()
    def _ranges(self, network: SegmentationNetwork) -> tuple[float, ...]:
        """The ranges that driving in integers needs."""
        images = self.training.images(np.unique(self.sampler.draw(0, RANGE_FRAMES)))
        return input_ranges(network.backbone, normalise(to_float(images)).to(self.device))

    @torch.inference_mode()
    def _measure(self, network: SegmentationNetwork) -> dict[str, float]:
        """The loss, the junction's accuracy and each class's intersection over union on the validation's frames."""
        frames, n = self.validation, len(SceneClass)
        counts, losses, right = np.zeros((n, n)), list[float](), list[float]()
        for ids in np.array_split(np.arange(len(frames)), max(1, len(frames) // FRAMES_A_PASS)):
            semantics, labels = _semantics(frames, ids), self.validation_labels[ids]
            with autocast(self.config.precision, self.device):
                classes, junction = network(normalise(to_float(frames.images(ids))).to(self.device))
            losses.append(float(self._loss(classes, junction, semantics, labels)))
            known = labels.isfinite()
            right += ((junction.cpu() > 0) == (labels > 0.5))[known].tolist()
            wanted = class_shares(torch.from_numpy(semantics)).argmax(dim=1).flatten().numpy()
            found = classes.argmax(dim=1).flatten().cpu().numpy()
            counts += np.bincount(n * wanted + found, minlength=n * n).reshape(n, n)
        union = counts.sum(0) + counts.sum(1) - counts.diagonal()
        iou = {f"iou/{kind.name.lower()}": counts[kind, kind] / union[kind] for kind in SceneClass if union[kind]}
        accuracy = {"junction/accuracy": float(np.mean(right))} if right else {}
        return {"loss": float(np.mean(losses)), **accuracy, **{name: float(value) for name, value in iou.items()}}

    def finish(self, folder: TrainingFolder, progress: Progress) -> None:
        """The network as it is becomes the finished one."""
        finish_as_it_is(self, folder)


def _semantics(frames: Frames, ids: Ids) -> NDArray[np.uint8]:
    """Semantic images (N, H, W) of frames by number."""
    semantics = frames.semantics(ids)
    assert semantics is not None
    return semantics


def start(
    config: PipelineConfig, network: SegmentationConfig, training: Frames, validation: Frames, device: str
) -> PipelineLearner:
    """What learns, before its first step. Raises EpisodeError for a recording without semantic images."""
    require_semantics((*training.episodes, *validation.episodes))
    torch.manual_seed(config.seed)
    model = SegmentationNetwork(network).to(device)
    labels, known = (
        np.concatenate([junction_labels(episode) for episode in part.episodes]) for part in (training, validation)
    )
    return PipelineLearner(
        config, model, training, validation, torch.from_numpy(labels).float(), torch.from_numpy(known).float(),
        sampler_of(labels, config), device,
    )  # fmt: skip
