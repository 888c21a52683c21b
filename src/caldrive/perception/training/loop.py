"""A training from a folder of episodes to a network on disk, whatever learns: steps, validation, and a way to go on
after a stop."""

from __future__ import annotations

import math
import os
import time
from collections.abc import Callable
from contextlib import closing, nullcontext
from dataclasses import dataclass, replace
from pathlib import Path

from caldrive.files import locked_folder
from caldrive.perception.dataset.frames import Frames
from caldrive.perception.training.config import LoopConfig
from caldrive.perception.training.distributed import ProcessGroup
from caldrive.perception.training.folder import Row, TrainingFolder
from caldrive.perception.training.resume import restore_state, save_state
from caldrive.perception.training.run import Learner, TrainingRun
from caldrive.progress import Progress
from caldrive.recordings.folder import find_episodes, split
from caldrive.scenarios import require_to_learn_from

Stop = Callable[[int], bool]
SPLIT_SEED = 0  # whatever a training's own: networks of other seeds learn from the same episodes


def never(step: int) -> bool:
    """Stops no run."""
    return False


@dataclass(frozen=True)
class TrainingFrames:
    """The frames that a network learns from, and those that it is measured on."""

    training: Frames
    validation: Frames


def read_frames(
    config: LoopConfig, size: tuple[int, int], data: Path | str, *, semantic_validation: bool = False
) -> TrainingFrames:
    """The frames of a folder's episodes, for images of this (height, width). semantic_validation: whether those that
    validate keep their semantic images. Raises ValueError for a town that may only judge."""
    episodes = find_episodes(data, semantic=config.wants_semantics)
    for town in {episode.scenario.town for episode in episodes}:
        require_to_learn_from(town)
    training, validation = split(episodes, config.validation_share, SPLIT_SEED)
    if not semantic_validation:
        validation = [replace(episode, semantics=None) for episode in validation]
    return TrainingFrames(Frames(training, size, config.cache_gb), Frames(validation, size))


def run_training(
    make_learner: Callable[[], Learner], out: Path, group: ProcessGroup, progress: Progress, stop: Stop = never
) -> Path:
    """Trains what `make_learner` makes, and returns the finished network's path, `out`/model.safetensors.

    In `out` lie also state.safetensors, from which the same call resumes, and metrics.jsonl: a row a step with its
    loss, and validation figures every `evaluate_every` steps and at the end; curves.png draws them, and where
    TensorBoard is installed it finds them in `out`/tensorboard. Until the network is finished it is called
    unfinished.safetensors. `stop` may end the run early after a step. Under torchrun the processes share each batch
    out, and the first one writes. Raises ValueError where another process works in `out`.
    """
    folder = TrainingFolder(out, group.is_main)
    with locked_folder(out) if group.is_main else nullcontext():
        run = TrainingRun(make_learner(), group)
        if folder.has_state:
            restore_state(folder.state, run)
        group.barrier()
        folder.open_metrics(run.step)
        with closing(folder):
            _train_all(run, folder, progress, stop)
    return folder.model


def _train_all(run: TrainingRun, folder: TrainingFolder, progress: Progress, stop: Stop) -> None:
    """The steps of the whole model, then what makes a finished network of it, unless somebody stops them."""
    steps = run.learner.steps
    while run.step < steps and not stop(run.step):
        _step(run, folder)
        if run.group.is_main:
            report(folder, run.config.steps, progress)
    if run.step == steps and run.group.is_main and not stop(run.step):
        run.learner.finish(folder, progress)


def report(folder: TrainingFolder, steps: int, progress: Progress) -> None:
    """Says how far a run of so many steps has come."""
    row = folder.rows[-1]
    progress(f"training, step {row['step']} of {steps}, loss {row['loss']:.3f}", row["step"] / steps)


def _step(run: TrainingRun, folder: TrainingFolder) -> None:
    """One step of the whole model, and what belongs after it."""
    config, began = run.config, time.perf_counter()
    row: Row = {"step": run.step + 1, "rate": run.rate, "loss": finite(run.advance(), run.step)}
    row["windows_per_s"] = config.batch / (time.perf_counter() - began)
    folder.add(row)
    last = run.step == run.learner.steps
    if last or run.step % config.evaluate_every == 0:
        if run.group.is_main:
            add_validation(run.learner.validate(folder.unfinished), folder, run.learner)
        run.group.barrier()
    if run.group.is_main and (last or run.step % config.save_every == 0):
        folder.write_metrics()
        save_state(folder.state, run)


def finish_as_it_is(learner: Learner, folder: TrainingFolder) -> None:
    """The network as it is becomes the finished one, where there is no second stage."""
    if not folder.has_finished(learner.config.steps):
        if not folder.unfinished.is_file():
            learner.validate(folder.unfinished)
        os.replace(folder.unfinished, folder.model)
    folder.remove_unfinished()


def add_validation(figures: dict[str, float], folder: TrainingFolder, learner: Learner) -> None:
    """Adds a validation's figures to the last step, and draws the curves anew."""
    folder.add_to_last({f"validation/{name}": value for name, value in figures.items()})
    folder.draw_curves(learner.figures)


def finite(loss: float, step: int) -> float:
    """The loss of a step. Raises ValueError where it is no number."""
    if not math.isfinite(loss):
        raise ValueError(f"found a loss of {loss} at step {step}, wanted a number: type a smaller --learning-rate")
    return loss
