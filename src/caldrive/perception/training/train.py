"""The training of CAL's network (section 3.1): the whole network, then its temporal blocks alone, then its camera
check."""

from __future__ import annotations

import os
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Generator, Tensor, nn

from caldrive.affordances import SPECS
from caldrive.perception.dataset.augmentation import augmented
from caldrive.perception.dataset.frames import Batch
from caldrive.perception.dataset.sampler import Sampler, data_summary
from caldrive.perception.evaluation.evaluate import evaluate
from caldrive.perception.images import normalise, to_float
from caldrive.perception.inference.engines import autocast
from caldrive.perception.network.calibration import calibrated, input_ranges
from caldrive.perception.network.camera_check import add_camera_check, load_camera_check
from caldrive.perception.network.checkpoint import CheckpointInfo, read_info, save_network
from caldrive.perception.network.config import NetworkConfig
from caldrive.perception.network.network import Network
from caldrive.perception.network.tensor_file import round_to_half
from caldrive.perception.targets import ClassWeights, class_weights, multitask_loss
from caldrive.perception.training.camera_check_stage import evidence_thresholds, train_camera_check
from caldrive.perception.training.config import TrainingConfig
from caldrive.perception.training.distributed import join_process_group
from caldrive.perception.training.folder import TrainingFolder
from caldrive.perception.training.history_stage import feature_table, train_temporal_blocks
from caldrive.perception.training.initial import initial_network, with_initial_weights, without_initial_weights
from caldrive.perception.training.loop import (
    Stop,
    TrainingFrames,
    add_validation,
    finite,
    never,
    read_frames,
    report,
    run_training,
)
from caldrive.perception.training.multitask import (
    SEGMENTATION,
    SEGMENTED_STAGE,
    MultiTaskModel,
    SegmentationHead,
    segmentation_loss,
)
from caldrive.progress import Progress, silent
from caldrive.recordings.folder import episode_paths

RANGE_FRAMES = 512  # on which the ranges of 8 bits are found


def train(
    config: TrainingConfig,
    data: Path | str,
    out: Path | str,
    network: NetworkConfig | None = None,
    progress: Progress = silent,
    stop: Stop = never,
) -> Path:
    """Train a network on the episodes in `data`, and return the finished one's path, `out`/model.safetensors.

    `loop.run_training` says what lies in `out`. While the temporal blocks learn alone, `features` holds what the
    finished backbone makes of the frames; before that the network has learnt to see without history, and its metrics
    are those without. Raises ValueError for settings or data that cannot be, and where another process works in `out`.
    """
    network, out = network or NetworkConfig(), Path(out)
    group = join_process_group(config.device, config.batch)
    is_resumed = TrainingFolder(out).has_state
    config = without_initial_weights(config) if is_resumed else with_initial_weights(config)
    episode_paths(data)  # without one, no folder is made

    def make_learner() -> AffordanceLearner:
        return start(config, network, read_frames(config, network.image_size, data), group.device)

    return run_training(make_learner, out, group, progress, stop)


@dataclass
class AffordanceLearner:
    """CAL's network, which learns six affordances (`run.Learner`)."""

    config: TrainingConfig
    model: MultiTaskModel
    frames: TrainingFrames
    sampler: Sampler
    class_weights: ClassWeights
    device: str
    figures: tuple[str, ...] = ("loss", *(spec.metric for spec in SPECS))
    network: Network = field(init=False)

    def __post_init__(self) -> None:
        self.network = self.model.network

    @property
    def history_steps(self) -> int:
        """Steps of the second stage; none where no block looks back."""
        return self.config.second_stage if self.network.span > 1 else 0

    @property
    def steps(self) -> int:
        """Steps of the first stage, of the whole network."""
        return self.config.steps - self.history_steps

    @property
    def context(self) -> int:
        """Frames of history that a window of the first stage brings along."""
        return 0 if self.history_steps else self.network.span - 1

    @property
    def network_settings(self) -> dict[str, Any]:
        """What the network is built from."""
        return asdict(self.network.config)

    @property
    def data_digest(self) -> str:
        """Tells the frames that it learns from from others."""
        return self.sampler.frames.digest

    def loss(self, step: int, share: slice, forward: nn.Module, generator: Generator) -> Tensor:
        """The multi-task loss of a step's windows, and the segmentation's."""
        batch, weights = self._batch(step, share), vars(self.config.loss_weights)
        images = normalise(augmented(batch.images, batch.semantics, batch.group, generator, self.config))
        targets = {name: target.to(self.device) for name, target in batch.targets.items()}
        with autocast(self.config.precision, self.device):
            outputs = forward(*(tensor.to(self.device) for tensor in (images, batch.index, batch.command)))
        loss = multitask_loss(outputs, targets, self.class_weights, weights)
        if batch.semantics is not None and SEGMENTATION in outputs:
            auxiliary = segmentation_loss(outputs[SEGMENTATION], batch.semantics, generator)
            loss = loss + weights[SEGMENTATION] * auxiliary
        return loss

    def _batch(self, step: int, share: slice) -> Batch:
        """A process' share of the step's windows."""
        config = self.config
        starts = self.sampler.draw(step, config.batch)[share]
        alternatives = self.sampler.alternatives(step, config.batch, config.alternative_share)[share]
        return self.sampler.frames.batch(starts, config.window, self.context, alternatives)

    def validate(self, path: Path) -> dict[str, float]:
        """Writes the network as it is, as the first stage sees, with its validation metrics, and returns them."""
        return self._validate(path, self.context)

    def _validate(self, path: Path, context: int) -> dict[str, float]:
        """Writes the network as it is, in 16 bits. context: frames of history that it sees."""
        config, frames = self.config, self.sampler.frames
        data = data_summary(frames, self.frames.validation)
        network = calibrated(self.network, data["train_classes"]).eval()
        round_to_half(network)
        metrics = evaluate(network, self.frames.validation, config.precision, self.device, context)
        drawn = np.unique(self.sampler.draw(0, RANGE_FRAMES))  # of a small recording the same ones come again and again
        images = normalise(to_float(frames.images(drawn)))
        ranges = input_ranges(network.backbone, images.to(self.device))
        files = {"initial": config.initial and Path(config.initial).name, "imagenet": Path(config.imagenet).name}
        training = asdict(config) | files  # not whose folders
        info = CheckpointInfo(network.config, data, metrics, training, config.seed, ranges)
        save_network(path, network, info, half=True)
        return metrics

    def finish(self, folder: TrainingFolder, progress: Progress) -> None:
        """The second stage, and the camera check."""
        if not folder.has_finished(self.config.steps):
            if not folder.unfinished.is_file():
                self.validate(folder.unfinished)
            if self.history_steps:
                self._train_history(folder, progress)
            else:
                os.replace(folder.unfinished, folder.model)
        folder.remove_unfinished()
        steps = min(self.config.camera_check_steps, self.config.steps)
        if steps and load_camera_check(folder.model) is None:
            check = train_camera_check(self.sampler.frames, steps, self.config.seed, progress)
            add_camera_check(folder.model, check, evidence_thresholds(check, self.frames.validation))

    def _train_history(self, folder: TrainingFolder, progress: Progress) -> None:
        """The temporal blocks learn alone."""
        network, config = self.network, self.config
        ranges = read_info(folder.unfinished).ranges
        features = feature_table(network, self.sampler.frames, ranges, folder.features, progress)
        losses = train_temporal_blocks(network, self.sampler, self.class_weights, config, features)
        for step, loss in enumerate(losses, start=self.steps + 1):
            folder.add({"step": step, "loss": finite(loss, step)})
            report(folder, config.steps, progress)
        network.to(self.device)
        add_validation(self._validate(folder.model, network.span - 1), folder, self)
        folder.write_metrics()


def start(
    config: TrainingConfig, network_config: NetworkConfig, frames: TrainingFrames, device: str
) -> AffordanceLearner:
    """What learns, before its first step."""
    torch.manual_seed(config.seed)
    network = initial_network(config, network_config)
    head = None
    if config.loss_weights.segmentation and frames.training.has_semantics:
        head = SegmentationHead(network.backbone.channels[SEGMENTED_STAGE])
    model = MultiTaskModel(network, head, config.backbone_chunk).to(device)
    sampler = Sampler(frames.training, config.window, config.balance, config.seed)
    weights = {name: weight.to(device) for name, weight in class_weights(sampler.class_counts()).items()}
    return AffordanceLearner(config, model, frames, sampler, weights, device)
