"""The second stage of a training: the temporal blocks learn alone, from the finished backbone's features.

A frame with its history costs the backbone as many passes as the history has frames. A finished backbone passes each
frame of the recording once, in the precision in which it drives; after that a step of the blocks, with history, takes
a hundredth of the time of a step with images. But those images were augmented, and these features are not: blocks of
one frame would learn nothing new here and forget what other pictures look like, and so they stay as they are.
"""

from __future__ import annotations

import copy
import hashlib
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import torch
from torch import Tensor, nn
from torch.optim import Adam

from caldrive.perception.dataset.frames import Frames, Ids
from caldrive.perception.dataset.sampler import Sampler
from caldrive.perception.images import normalise, to_float
from caldrive.perception.inference.engines import BackboneEngine, backbone_engine
from caldrive.perception.inference.precision import driving_precision
from caldrive.perception.network.backbone import Backbone
from caldrive.perception.network.network import Network
from caldrive.perception.network.tensor_file import CheckpointError, read_tensors, round_to_half, write_tensors
from caldrive.perception.targets import ClassWeights, multitask_loss
from caldrive.perception.training.config import TrainingConfig
from caldrive.perception.training.run import SEED_STRIDE, gradient_step, learning_rate
from caldrive.progress import Progress

FRAMES_A_FILE, FRAMES_A_PASS = 8192, 64


def feature_table(
    network: Network, frames: Frames, ranges: tuple[float, ...], folder: Path, progress: Progress
) -> Tensor:
    """The features of every frame (N, F) by the backbone, rounded as it is stored; kept in `folder`, so that it goes on
    after a kill. ranges: those that are stored with the network."""
    network.cpu().eval()
    round_to_half(network)
    precision = driving_precision("auto", ranges)
    digest = _digest(network.backbone, precision, ranges, frames)
    engine = backbone_engine(precision, copy.deepcopy(network.backbone), network.config.image_size, ranges)
    table = torch.empty(len(frames), network.backbone.n_features(*network.config.image_size)).half()
    for number, first in enumerate(range(0, len(frames), FRAMES_A_FILE)):
        path = folder / f"{number:04d}.safetensors"
        ids = np.arange(first, min(first + FRAMES_A_FILE, len(frames)))
        features = _saved_features(path, digest)
        if features is None:
            features = _features(frames, ids, engine)
            write_tensors(path, {"features": features}, {"kind": "features", "digest": digest})
        table[ids[0] : ids[-1] + 1] = features
        progress("features", (int(ids[-1]) + 1) / len(frames))
    return table


def _digest(backbone: Backbone, precision: str, ranges: tuple[float, ...], frames: Frames) -> str:
    """Of all that the features depend on: the backbone, how it computes, and which frames it sees."""
    digest = hashlib.sha256(repr((precision, ranges, frames.digest)).encode())
    for value in backbone.state_dict().values():
        digest.update(value.detach().cpu().numpy().tobytes())
    return digest.hexdigest()[:16]


@torch.inference_mode()
def _features(frames: Frames, ids: Ids, engine: BackboneEngine) -> Tensor:
    """Features (N, F) of frames by number, in 16 bits."""
    parts = (ids[k : k + FRAMES_A_PASS] for k in range(0, len(ids), FRAMES_A_PASS))
    return torch.cat([engine(normalise(to_float(frames.images(part)))).half() for part in parts])


def _saved_features(path: Path, digest: str) -> Tensor | None:
    """The features in a file, where they are the wanted ones."""
    try:
        tensors, header = read_tensors(path)
    except CheckpointError:
        return None
    return tensors["features"] if header.get("digest") == digest else None


def train_temporal_blocks(
    network: Network, sampler: Sampler, class_weights: ClassWeights, config: TrainingConfig, features: Tensor
) -> Iterator[float]:
    """Trains a network's temporal blocks on features (N, F) of all frames; yields each step's loss."""
    steps = config.second_stage
    weights = {name: weight.cpu() for name, weight in class_weights.items()}
    blocks = nn.ModuleDict({name: block for name, block in network.task_blocks().items() if block.config.temporal})
    optimizer = Adam(blocks.parameters(), config.learning_rate, config.betas)
    blocks.train()
    for step in range(steps):
        run_step = config.steps - steps + step  # counted through both stages
        torch.manual_seed(config.seed * SEED_STRIDE + run_step)  # dropout
        history, command, targets = _history_batch(sampler, network.span, config, features, run_step)
        outputs = {name: block(history, command) for name, block in blocks.items()}
        loss = multitask_loss(outputs, targets, weights)
        gradient_step(optimizer, loss, learning_rate(step, steps, config), config.clip)  # with a warm-up again
        yield float(loss.detach())


def _history_batch(
    sampler: Sampler, span: int, config: TrainingConfig, features: Tensor, run_step: int
) -> tuple[Tensor, Tensor, dict[str, Tensor]]:
    """The features (B, T, F), commands (B, S) and targets (B * S,) of a step."""
    window, batch = config.window, config.history_batch
    ids = sampler.frames.windows(sampler.draw(run_step, batch), window, span - 1)
    alternatives = sampler.alternatives(run_step, batch, config.alternative_share)
    command, targets = sampler.frames.commands_and_targets(ids[:, -window:], alternatives)
    return features[torch.from_numpy(ids)].float(), command, targets
