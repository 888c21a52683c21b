"""The second step of a search: the best block of each task in one network, trained jointly, as a file that drives.

The backbone stays as it is, so that the blocks share nothing but the frames that they learn from.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import torch

from caldrive.affordances import SPECS
from caldrive.perception.dataset.sampler import data_summary
from caldrive.perception.evaluation.evaluate import metrics
from caldrive.perception.network.calibration import calibrated
from caldrive.perception.network.camera_check import add_camera_check, load_camera_check
from caldrive.perception.network.checkpoint import CheckpointInfo, load_network, read_info, save_network
from caldrive.perception.network.config import BlockConfig
from caldrive.perception.network.network import Network
from caldrive.perception.network.tensor_file import UNFINISHED, CheckpointError, round_to_half
from caldrive.perception.training.loop import finite
from caldrive.progress import Progress
from caldrive.search.best import FIRST_SEED
from caldrive.search.config import SearchConfig
from caldrive.search.examples import Examples, Source, features_digest
from caldrive.search.learning import learn, outputs_of, score, training_config, training_seed
from caldrive.search.studies import worker_examples

JOINT_NUMBER = FIRST_SEED + 1000  # of the training, for its seed


@dataclass(frozen=True)
class JointNetwork:
    """A network of the best blocks: its file, and its scores by task on the frames that blocks are compared on."""

    path: Path
    scores: Mapping[str, float]


def train_joint(
    source: Source, config: SearchConfig, blocks: Mapping[str, BlockConfig], path: Path, progress: Progress
) -> JointNetwork:
    """Trains blocks by their task on the network's backbone, and writes the whole network, unless it is there.

    The other blocks, and the camera check, stay those of the network. Unlike a trial, the blocks also learn from the
    beginning of an episode: a drive has one, too.
    """
    network, info = load_network(source.model)
    made_by = _made_by(source, config, blocks)
    if (scores := _saved_scores(path, made_by)) is not None:
        return JointNetwork(path, scores)
    seed = training_seed(config.seed, JOINT_NUMBER)
    torch.manual_seed(seed)
    network = _with_blocks(network, blocks)
    training, validation = worker_examples(source)
    learning = training_config(config, seed, config.joint_steps)
    learners = {name: network.task_blocks()[name] for name in blocks}
    for step, loss in enumerate(learn(learners, training, learning), start=1):
        progress(f"the best blocks together, step {step}, loss {finite(loss, step):.3f}", step / config.joint_steps)
    data = data_summary(training.frames, validation.frames)
    network = calibrated(network, {name: n for name, n in data["train_classes"].items() if name in blocks}).eval()
    round_to_half(network)
    figures = metrics(_outputs(network, validation), validation.frames.targets)
    measured = {name: value for name, value in figures.items() if value is not None}
    scores = network_scores(network, validation)
    info = CheckpointInfo(network.config, data, measured, made_by | {"scores": scores}, config.seed, info.ranges)
    unfinished = path.with_name(UNFINISHED)
    save_network(unfinished, network, info, half=True)
    if (check := load_camera_check(source.model)) is not None:
        add_camera_check(unfinished, *check)
    os.replace(unfinished, path)
    return JointNetwork(path, scores)


def network_scores(network: Network, validation: Examples) -> dict[str, float]:
    """A calibrated network's scores by task on the frames that blocks are compared on."""
    scores: dict[str, float | None] = {}
    for spec in SPECS:
        output = outputs_of(network.task_blocks()[spec.name], validation, validation.targets)
        target = validation.frames.targets[spec.name][torch.from_numpy(validation.targets)]
        scores[spec.name] = score(spec.name, output, target)
    return {name: value for name, value in scores.items() if value is not None}


def _outputs(network: Network, examples: Examples) -> dict[str, torch.Tensor]:
    """A network's outputs on all frames."""
    everything = np.arange(len(examples.frames))
    return {name: outputs_of(block, examples, everything) for name, block in network.task_blocks().items()}


def _with_blocks(trained: Network, blocks: Mapping[str, BlockConfig]) -> Network:
    """A network with a trained one's backbone and blocks, but for those that are new."""
    network = Network(replace(trained.config, **dict[str, Any](blocks)))
    network.backbone.load_state_dict(trained.backbone.state_dict())
    for name, block in trained.task_blocks().items():
        if name not in blocks:
            network.blocks[name].load_state_dict(block.state_dict())
    return network


def _made_by(source: Source, config: SearchConfig, blocks: Mapping[str, BlockConfig]) -> dict[str, Any]:
    """What the network depends on, as its header keeps it."""
    return {
        "search": config.decisive() | {"joint_steps": config.joint_steps},
        "features": features_digest(source),
        "blocks": {name: asdict(block) for name, block in sorted(blocks.items())},
    }


def _saved_scores(path: Path, made_by: Mapping[str, Any]) -> dict[str, float] | None:
    """The scores of the network in a file, where it is the wanted one and whole."""
    try:
        training = dict(read_info(path).training)
    except CheckpointError:
        return None
    scores: dict[str, float] | None = training.pop("scores", None)
    return scores if training == made_by else None
