"""The last part of a training: task blocks that look back learn alone, from what the finished backbone makes of the
frames.

A frame with its history costs the backbone as many passes as the history has frames. A finished backbone passes each
frame of the recording once, in the precision in which it drives; after that a step of the blocks, with history, takes
a hundredth of the time of a step with images. But those images were augmented, and these features are not: blocks of
one frame would learn nothing new here and forget what other pictures look like, and so they stay as they are.
"""

from __future__ import annotations

import copy
import hashlib
import shutil
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import torch
from torch import Tensor, nn
from torch.optim import Adam

from caldrive.perception.dataset.frames import Frames, Ids
from caldrive.perception.images import normalise, to_float
from caldrive.perception.inference.engines import Features, driving_precision, features_in
from caldrive.perception.network.backbone import Backbone
from caldrive.perception.network.checkpoint import (
    CheckpointError,
    CheckpointInfo,
    read_tensors,
    round_to_half,
    write_tensors,
)
from caldrive.perception.targets import loss
from caldrive.perception.training.run import TrainingRun, descend, learning_rate
from caldrive.progress import Progress

FOLDER, CHUNK, BATCH = "features", 8192, 64  # frames in a file, and at once


def _digest(backbone: Backbone, precision: str, ranges: tuple[float, ...], frames: Frames) -> str:
    """Of all that the features depend on: the backbone, how it computes, and which frames it sees."""
    found = hashlib.sha256(repr((precision, ranges, frames.digest)).encode())
    for value in backbone.state_dict().values():
        found.update(value.detach().cpu().numpy().tobytes())
    return found.hexdigest()[:16]


@torch.inference_mode()
def _see(frames: Frames, ids: Ids, features: Features) -> Tensor:
    """Features (N, F) of frames by number, in 16 bits."""
    parts = (ids[k : k + BATCH] for k in range(0, len(ids), BATCH))
    return torch.cat([features(normalise(to_float(frames.images(part)))).half() for part in parts])


def _kept(path: Path, digest: str) -> Tensor | None:
    """The features in a file, where they are the wanted ones."""
    try:
        tensors, header = read_tensors(path)
    except CheckpointError:
        return None
    return tensors["features"] if header.get("digest") == digest else None


def feature_table(run: TrainingRun, info: CheckpointInfo, out: Path, progress: Progress) -> Tensor:
    """What the backbone, rounded as it is stored, makes of every frame (N, F); kept in `out`, so that it goes on after
    a kill. info: of the network as it is stored."""
    network, frames = run.network.cpu().eval(), run.sampler.frames
    round_to_half(network)
    precision = driving_precision("auto", info)
    digest = _digest(network.backbone, precision, info.ranges, frames)
    features = features_in(precision, copy.deepcopy(network), info)
    config = network.config
    table = torch.empty(len(frames), network.backbone.n_features(config.image_height, config.image_width)).half()
    for number, first in enumerate(range(0, len(frames), CHUNK)):
        path, ids = out / FOLDER / f"{number:04d}.safetensors", np.arange(first, min(first + CHUNK, len(frames)))
        part = _kept(path, digest)
        if part is None:
            part = _see(frames, ids, features)
            write_tensors(path, {"features": part}, {"kind": "features", "digest": digest})
        table[ids[0] : ids[-1] + 1] = part
        progress("features", (int(ids[-1]) + 1) / len(frames))
    return table


def forget_features(out: Path) -> None:
    """Frees the disk of what `feature_table` kept."""
    shutil.rmtree(out / FOLDER, ignore_errors=True)


def learn_blocks(run: TrainingRun, features: Tensor) -> Iterator[float]:
    """Trains the run's network's blocks that look back on features (N, F) of all its frames; yields each step's
    loss."""
    config = replace(run.config, steps=run.config.block_steps)  # the rate's warm-up and cosine begin anew
    weights = {name: weight.cpu() for name, weight in run.weights.items()}
    blocks = nn.ModuleDict({name: b for name, b in run.network.task_blocks().items() if b.config.length > 1})
    optimizer = Adam(blocks.parameters(), config.learning_rate)
    blocks.train()
    for step in range(config.block_steps):
        number = run.config.steps + step  # of the whole training
        torch.manual_seed(config.seed * 1_000_003 + number)  # dropout
        seen, command, targets = _lesson(run, features, number)
        total = loss({name: block(seen, command) for name, block in blocks.items()}, targets, weights)
        descend(optimizer, total, learning_rate(step, config), config.clip)
        yield float(total.detach())


def _lesson(run: TrainingRun, features: Tensor, number: int) -> tuple[Tensor, Tensor, dict[str, Tensor]]:
    """The features (B, T, F), commands (B, S) and targets (B * S,) of a step of the whole training."""
    sampler, window, batch = run.sampler, run.config.window, run.config.block_batch
    ids = sampler.frames.windows(sampler.draw(number, batch), window, run.network.span - 1)
    command, targets = sampler.frames.lessons(ids[:, -window:], sampler.others(number, batch, run.config.others))
    return features[torch.from_numpy(ids)].float(), command, targets
