"""Training from a folder of episodes to a network on disk: both stages, validation, and a way to go on after a stop."""

from __future__ import annotations

import math
import os
import time
from collections.abc import Callable
from contextlib import closing, nullcontext
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np

from caldrive.files import locked_folder
from caldrive.perception.dataset.frames import Frames
from caldrive.perception.dataset.sampler import data_summary
from caldrive.perception.evaluation.evaluate import evaluate
from caldrive.perception.images import normalise, to_float
from caldrive.perception.network.calibration import calibrated, input_ranges
from caldrive.perception.network.camera_check import add_camera_check, load_camera_check
from caldrive.perception.network.checkpoint import CheckpointInfo, read_info, round_to_half, save_network
from caldrive.perception.network.config import NetworkConfig
from caldrive.perception.training.camera_check_stage import evidence_thresholds, train_camera_check
from caldrive.perception.training.config import TrainingConfig
from caldrive.perception.training.distributed import join_process_group
from caldrive.perception.training.folder import Row, TrainingFolder, draw_curves
from caldrive.perception.training.history_stage import feature_table, train_temporal_blocks
from caldrive.perception.training.initial import with_initial_weights, without_initial_weights
from caldrive.perception.training.resume import restore_state, save_state
from caldrive.perception.training.run import TrainingRun, start_run
from caldrive.progress import Progress, silent
from caldrive.recordings.folder import episode_paths, find_episodes, split
from caldrive.scenarios import require_not_held_out

RANGE_FRAMES = 512  # on which the ranges of 8 bits are found


def train(
    config: TrainingConfig,
    data: Path | str,
    out: Path | str,
    network: NetworkConfig | None = None,
    progress: Progress = silent,
    stop: Callable[[int], bool] = lambda step: False,
) -> Path:
    """Train a network on the episodes in `data`, and return the finished one's path, `out`/model.safetensors.

    In `out` lie also state.safetensors, from which the same call resumes, and metrics.jsonl: a row a step with its
    loss, and validation metrics every `evaluate_every` steps and at the end; curves.png draws them, and where
    TensorBoard is installed it finds them in `out`/tensorboard. Until the network is finished it is called
    unfinished.safetensors. While the temporal blocks learn alone, `features` holds what the finished backbone makes of
    the frames; before that the network has learnt to see without history, and its metrics are those without. `stop` may
    end the run early after a step. Under torchrun the processes share each batch out, and the first one writes. Raises
    ValueError for settings or data that cannot be, and where another process works in `out`.
    """
    network = network or NetworkConfig()
    group = join_process_group(config.device, config.batch)
    folder = TrainingFolder(Path(out), group.is_main)
    resumed = folder.has_state
    config = without_initial_weights(config) if resumed else with_initial_weights(config)
    episode_paths(data)  # without one, no folder is made
    with locked_folder(Path(out)) if group.is_main else nullcontext():
        frames, validation = _read_frames(config, network, data)
        run = start_run(config, network, frames, group)
        if resumed:
            restore_state(folder.state, run)
        group.barrier()
        folder.open_metrics(run.step)
        with closing(folder):
            _train_all(run, validation, folder, progress if group.is_main else silent, stop)
    return folder.model


def _read_frames(config: TrainingConfig, network: NetworkConfig, data: Path | str) -> tuple[Frames, Frames]:
    """The frames that train, and those that validate. Raises ValueError for a town that may only judge."""
    episodes = find_episodes(data, semantic=config.loss_weights.segmentation > 0 or config.recolour.enabled)
    for town in {episode.scenario.town for episode in episodes}:
        require_not_held_out(town)
    training, validation = split(episodes, config.validation_share, config.seed)
    validation = [replace(episode, semantics=None) for episode in validation]  # only a loss looks at them
    return Frames(training, network.image_size, config.cache_gb), Frames(validation, network.image_size)


def _train_all(
    run: TrainingRun, validation: Frames, folder: TrainingFolder, progress: Progress, stop: Callable[[int], bool]
) -> None:
    """The steps of the whole network, then those of its temporal blocks alone, unless somebody stops them."""
    while run.step < run.steps and not stop(run.step):
        _step(run, validation, folder)
        _report(run, folder, progress)
    if run.step == run.steps and run.group.is_main and not stop(run.step):
        _finish(run, validation, folder, progress)


def _report(run: TrainingRun, folder: TrainingFolder, progress: Progress) -> None:
    """Says how far the run has come."""
    row, steps = folder.rows[-1], run.config.steps
    progress(f"training, step {row['step']} of {steps}, loss {row['loss']:.3f}", row["step"] / steps)


def _step(run: TrainingRun, validation: Frames, folder: TrainingFolder) -> None:
    """One step of the whole network, and what belongs after it."""
    config, began = run.config, time.perf_counter()
    row: Row = {"step": run.step + 1, "rate": run.rate, "loss": _number(run.advance(), run.step)}
    row["windows_per_s"] = config.batch / (time.perf_counter() - began)
    folder.add(row)
    last = run.step == run.steps
    if last or run.step % config.evaluate_every == 0:
        if run.group.is_main:
            folder.add_to_last(validate(run, validation, folder.unfinished, run.context))
            draw_curves(folder.rows, folder.curves)
        run.group.barrier()
    if run.group.is_main and (last or run.step % config.save_every == 0):
        folder.write_metrics()
        save_state(folder.state, run)


def _finish(run: TrainingRun, validation: Frames, folder: TrainingFolder, progress: Progress) -> None:
    """What makes a finished network of a whole one, unless it is there already, and its camera check. A network that
    somebody removed comes again."""
    if not folder.has_finished(run.config.steps):
        if not folder.unfinished.is_file():
            validate(run, validation, folder.unfinished, run.context)
        if run.history_steps:
            _train_history(run, validation, folder, progress)
        else:
            os.replace(folder.unfinished, folder.model)
    folder.remove_unfinished()
    steps = min(run.config.camera_check_steps, run.config.steps)
    if steps and load_camera_check(folder.model) is None:
        check = train_camera_check(run.sampler.frames, steps, run.config.seed, progress)
        add_camera_check(folder.model, check, evidence_thresholds(check, validation))


def _train_history(run: TrainingRun, validation: Frames, folder: TrainingFolder, progress: Progress) -> None:
    """The temporal blocks learn alone."""
    features = feature_table(run, read_info(folder.unfinished).ranges, folder.features, progress)
    for step, loss in enumerate(train_temporal_blocks(run, features), start=run.steps + 1):
        folder.add({"step": step, "loss": _number(loss, step)})
        _report(run, folder, progress)
    run.network.to(run.group.device)
    folder.add_to_last(validate(run, validation, folder.model, run.network.span - 1))
    draw_curves(folder.rows, folder.curves)
    folder.write_metrics()


def validate(run: TrainingRun, validation: Frames, model: Path, context: int) -> Row:
    """Write the network as it is, in 16 bits, with its validation metrics, and return them as `validation/<name>`.

    context: frames of history that it sees.
    """
    sampler, config = run.sampler, run.config
    data = data_summary(sampler.frames, validation)
    network = calibrated(run.network, data["train_classes"]).eval()
    round_to_half(network)
    metrics = evaluate(network, validation, config.precision, run.group.device, context)
    drawn = np.unique(sampler.draw(0, RANGE_FRAMES))  # of a small recording the same ones come again and again
    images = normalise(to_float(sampler.frames.images(drawn)))
    ranges = input_ranges(network.backbone, images.to(run.group.device))
    files = {"initial": config.initial and Path(config.initial).name, "imagenet": Path(config.imagenet).name}
    training = asdict(config) | files  # not whose folders
    info = CheckpointInfo(network.config, data, metrics, training, config.seed, ranges)
    save_network(model, network, info, half=True)
    return {f"validation/{name}": value for name, value in metrics.items()}


def _number(loss: float, step: int) -> float:
    """The loss of a step. Raises ValueError where it is no number."""
    if not math.isfinite(loss):
        raise ValueError(f"found a loss of {loss} at step {step}, wanted a number: type a smaller --learning-rate")
    return loss
