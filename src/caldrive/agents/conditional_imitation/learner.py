"""The training of conditional imitation learning: squared errors of what the driver did, on one command's branch."""

from __future__ import annotations

import copy
import math
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Generator, Tensor, nn

from caldrive.agents.conditional_imitation.augmentation import augment_as_published
from caldrive.agents.conditional_imitation.checkpoint import ImitationInfo, round_to_bytes, save_imitation
from caldrive.agents.conditional_imitation.config import ImitationConfig, ImitationNetworkConfig, ImitationWeights
from caldrive.agents.conditional_imitation.labels import (
    CommandSampler,
    Demonstrations,
    corl2017_demonstrations,
    recorded_demonstrations,
)
from caldrive.agents.conditional_imitation.network import OUTPUTS, SPEED_SCALE, ImitationNetwork
from caldrive.perception.dataset.augmentation import augmented
from caldrive.perception.dataset.frames import Ids
from caldrive.perception.images import to_float
from caldrive.perception.inference.engines import autocast
from caldrive.perception.network.calibration import input_ranges
from caldrive.perception.network.network import COMMANDS
from caldrive.perception.training.distributed import join_process_group
from caldrive.perception.training.folder import TrainingFolder
from caldrive.perception.training.loop import Stop, finish_as_it_is, never, read_frames, run_training
from caldrive.progress import Progress, silent
from caldrive.recordings.corl2017 import FOLDERS, HEIGHT, WIDTH, read_corl2017
from caldrive.recordings.folder import episode_paths

FRAMES_A_PASS = 64
WHEEL_ANGLE, CARLA_WHEEL_ANGLE = 35.0, 70.0  # degrees at full steering: of the embedded car, of CARLA's
RANGE_FRAMES = 512  # on which the ranges of 8 bits are found


def train_imitation(
    config: ImitationConfig,
    data: Path,
    out: Path,
    network: ImitationNetworkConfig,
    progress: Progress = silent,
    stop: Stop = never,
) -> Path:
    """Train a network on the episodes in `data`, or on the HDF5 files in its SeqTrain and SeqVal; returns the finished
    one's path, `out`/model.safetensors.

    `loop.run_training` says what lies in `out`. Raises ValueError for settings or data that cannot be, and where
    another process works in `out`.
    """
    group = join_process_group(config.device, config.batch)
    is_hdf5 = all((data / name).is_dir() for name in FOLDERS)
    if not is_hdf5:
        _require_recording(data)  # without one, no folder is made

    def make_learner() -> ImitationLearner:
        read = _read_corl2017 if is_hdf5 else _read_recording
        return start(config, network, read(config, network, data), group.device)

    return run_training(make_learner, out, group, progress, stop)


def _require_recording(data: Path) -> None:
    """Raises ValueError where a folder holds no recorded episodes: HDF5 files want both of their folders."""
    for folder in (data, data / FOLDERS[0], data / FOLDERS[1]):
        if any(folder.glob("*.h5")):
            raise ValueError(
                f"found HDF5 files in {folder}, wanted {FOLDERS[0]} and {FOLDERS[1]} beside each other: "
                "type --data with the folder that holds both"
            )
    episode_paths(data)


@dataclass(frozen=True)
class ImitationData:
    """What a training learns from, and what it is measured on."""

    training: Demonstrations
    validation: Demonstrations
    validation_keys: tuple[str, ...] = ()
    """Of the episodes that are kept for validation."""


def _read_recording(config: ImitationConfig, network: ImitationNetworkConfig, data: Path) -> ImitationData:
    """A folder of recorded episodes."""
    frames, wheel = read_frames(config, network.image_size, data), math.radians(config.wheel_angle or WHEEL_ANGLE)
    keys = tuple(sorted({episode.key for episode in frames.validation.episodes}))
    training, validation = (recorded_demonstrations(part, wheel) for part in (frames.training, frames.validation))
    return ImitationData(training, validation, keys)


def _read_corl2017(config: ImitationConfig, network: ImitationNetworkConfig, data: Path) -> ImitationData:
    """A folder with SeqTrain and SeqVal. Raises ValueError where the network takes images of another size."""
    if network.image_size != (HEIGHT, WIDTH):
        raise ValueError(
            f"found HDF5 files of {WIDTH} x {HEIGHT} pixels in {data}, wanted {network.image_width} x "
            f"{network.image_height} for the network: leave --network.image-width and --network.image-height out"
        )
    parts = [read_corl2017(data / name) for name in FOLDERS]
    wheel = math.radians(config.wheel_angle or (WHEEL_ANGLE if parts[0].is_ours else CARLA_WHEEL_ANGLE))
    training, validation = (corl2017_demonstrations(part, wheel) for part in parts)
    return ImitationData(training, validation)


def imitation_loss(
    outputs: tuple[Tensor, Tensor], controls: Tensor, speed: Tensor, weights: ImitationWeights
) -> Tensor:
    """The weighted sum of the mean squared errors. outputs: of the network; controls (N, 3), as named by `OUTPUTS`;
    speed (N,), m/s, which counts as a share of 25 m/s."""
    predicted, predicted_speed = (output.float() for output in outputs)
    errors = (predicted - controls).square().mean(dim=0)
    parts = [getattr(weights, name) * error for name, error in zip(OUTPUTS, errors, strict=True)]
    speed_error = ((predicted_speed - speed) / SPEED_SCALE).square().mean()
    return torch.stack([*parts, weights.speed * speed_error]).sum()


@dataclass
class ImitationLearner:
    """The network of conditional imitation learning (`run.Learner`)."""

    config: ImitationConfig
    model: ImitationNetwork
    data: ImitationData
    sampler: CommandSampler
    device: str
    figures: tuple[str, ...] = ("loss", *(f"{name}/mae" for name in (*OUTPUTS, "speed")))

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
        return self.data.training.digest

    def loss(self, step: int, share: slice, forward: nn.Module, generator: Generator) -> Tensor:
        """The loss of a step's frames."""
        ids = self.sampler.draw(step, self.config.batch)[share]
        images = self.model.prepared(self._images(ids, generator)).to(self.device)
        speed, command, controls = self._targets(self.data.training, ids)
        with autocast(self.config.precision, self.device):
            outputs = forward(images, speed, command)
        return imitation_loss(outputs, controls, speed, self.config.weights)

    def _images(self, ids: Ids, generator: Generator) -> Tensor:
        """A batch's images (N, 3, H, W) in [0, 1], augmented."""
        images = self.data.training.images(ids)
        if self.config.published_augmentation:
            return augment_as_published(to_float(images), generator)
        semantics = self.data.training.semantics(ids) if self.config.recolour.enabled else None
        return augmented(images, semantics, torch.arange(len(ids)), generator, self.config)

    def _targets(self, frames: Demonstrations, ids: Ids) -> tuple[Tensor, Tensor, Tensor]:
        """Speeds (N,), commands (N,) and controls (N, 3) of frames by number."""
        values = (frames.speed[ids].astype(np.float32), frames.command[ids], frames.controls[ids].astype(np.float32))
        speed, command, controls = (torch.from_numpy(value).to(self.device) for value in values)
        return speed, command, controls

    def validate(self, path: Path) -> dict[str, float]:
        """Writes the network as it is, with its validation's figures, and returns them."""
        network = copy.deepcopy(self.model).eval()
        round_to_bytes(network)
        metrics = self._measure(network)
        data = {
            "train_frames": len(self.data.training), "validation_frames": len(self.data.validation),
            "validation_episodes": list(self.data.validation_keys),
        }  # fmt: skip
        info = ImitationInfo(network.config, data, metrics, asdict(self.config), self._ranges(network))
        save_imitation(path, network, info)
        return metrics

    @torch.inference_mode()
    def _ranges(self, network: ImitationNetwork) -> tuple[float, ...]:
        """The ranges that driving in integers needs."""
        ids = np.unique(self.sampler.draw(0, RANGE_FRAMES))  # of a small recording the same ones come again and again
        images = network.prepared(to_float(self.data.training.images(ids)))
        return input_ranges(network.trunk, images.to(self.device))

    @torch.inference_mode()
    def _measure(self, network: ImitationNetwork) -> dict[str, float]:
        """Mean errors on the frames kept for validation: all together, and of the steering for each command."""
        frames = self.data.validation
        parts = np.array_split(np.arange(len(frames)), max(1, len(frames) // FRAMES_A_PASS))
        outputs = [self._outputs(network, frames, ids) for ids in parts]
        controls, speed = (torch.cat(part) for part in zip(*outputs, strict=True))
        wanted_speed, command, wanted = self._targets(frames, np.arange(len(frames)))
        errors = (controls - wanted).abs()
        figures = {f"{name}/mae": float(errors[:, k].mean()) for k, name in enumerate(OUTPUTS)}
        figures["speed/mae"] = float((speed - wanted_speed).abs().mean())
        for number, one in enumerate(COMMANDS):
            if bool((command == number).any()):
                figures[f"steer/mae/{one.value}"] = float(errors[command == number, 0].mean())
        figures["loss"] = float(imitation_loss((controls, speed), wanted, wanted_speed, self.config.weights))
        return figures

    def _outputs(self, network: ImitationNetwork, frames: Demonstrations, ids: Ids) -> tuple[Tensor, Tensor]:
        """What a network makes of frames by number."""
        speed, command, _ = self._targets(frames, ids)
        with autocast(self.config.precision, self.device):
            images = network.prepared(to_float(frames.images(ids))).to(self.device)
            controls, seen_speed = network(images, speed, command)
        return controls.float(), seen_speed.float()

    def finish(self, folder: TrainingFolder, progress: Progress) -> None:
        """The network as it is becomes the finished one."""
        finish_as_it_is(self, folder)


def start(
    config: ImitationConfig,
    network: ImitationNetworkConfig,
    data: ImitationData,
    device: str,
) -> ImitationLearner:
    """What learns, before its first step."""
    torch.manual_seed(config.seed)
    model = ImitationNetwork(network).to(device)
    sampler = CommandSampler(data.training, config.balance, config.seed)
    return ImitationLearner(config, model, data, sampler, device)
