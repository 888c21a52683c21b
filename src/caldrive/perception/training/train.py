"""Training from a folder of episodes to a network on disk, with its progress, its curves, and a way to go on."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from contextlib import closing
from dataclasses import asdict
from pathlib import Path

from caldrive.perception.dataset.frames import Frames
from caldrive.perception.dataset.sampler import summary
from caldrive.perception.evaluation.evaluate import evaluate
from caldrive.perception.images import normalise, to_float
from caldrive.perception.network.calibration import calibrated, input_ranges
from caldrive.perception.network.checkpoint import (
    CheckpointInfo,
    load_network,
    round_to_half,
    save_network,
)
from caldrive.perception.network.config import PerceptionConfig
from caldrive.perception.training.config import TrainingConfig
from caldrive.perception.training.curves import (
    CURVES,
    METRICS,
    MODEL,
    STATE,
    Board,
    Row,
    _write_rows,
    draw_curves,
    kept_rows,
)
from caldrive.perception.training.distributed import join
from caldrive.perception.training.history_stage import feature_table, forget_features, learn_blocks
from caldrive.perception.training.resume import restore_state, save_state
from caldrive.perception.training.run import TrainingRun, learning_rate, start
from caldrive.progress import Progress, silent
from caldrive.recordings.folder import find_episodes, split

RANGED = 512  # frames on which the ranges of 8 bits are found


def validate(run: TrainingRun, held: Frames, model: Path, context: int) -> Row:
    """Write the network as it is, in 16 bits, with its validation metrics, and return them as `validation/<name>`.

    context: frames of history that it sees.
    """
    sampler, config = run.sampler, run.config
    data = summary(sampler.frames, held)
    network = calibrated(run.network, data["train_classes"]).eval()
    round_to_half(network)
    found = evaluate(network, held, config.precision, run.team.device, context)
    seen = normalise(to_float(sampler.frames.images(sampler.draw(0, RANGED))))
    ranges = input_ranges(network.backbone, seen.to(run.team.device))
    told = asdict(config) | {"initial": config.initial and Path(config.initial).name}  # not whose folder
    info = CheckpointInfo(network.config, data, found, told, config.seed, ranges)
    save_network(model, network, info, half=True)
    return {f"validation/{name}": value for name, value in found.items()}


def train(
    config: TrainingConfig,
    data: Path | str,
    out: Path | str,
    perception: PerceptionConfig | None = None,
    imagenet: Path | None = None,
    progress: Progress = silent,
    stop: Callable[[int], bool] = lambda step: False,
) -> Path:
    """Train a network on the episodes in `data`, and return the finished one's path, `out`/model.safetensors.

    In `out` lie also state.safetensors, from which the same call resumes, and metrics.jsonl: a row a step with its
    loss, and validation metrics every `evaluate_every` steps and at the end; curves.png draws them, and where
    TensorBoard is installed it finds them in `out`/tensorboard. While the blocks learn alone, `features` holds what the
    finished backbone makes of the frames; before that the network has learnt to see without history, and its metrics
    are those without. `stop` may end the run early after a step. Under torchrun the processes share each batch out,
    and the first one writes.
    """
    out, perception = Path(out), perception or PerceptionConfig()
    team = join(config.device, config.batch)
    progress = progress if team.leads else silent
    size = (perception.image_height, perception.image_width)
    train_episodes, held_episodes = split(
        find_episodes(data, semantic=config.segmentation > 0 or (config.augment and config.repaint)),
        config.validation_share,
        config.seed,
    )
    frames, held = Frames(train_episodes, size, config.cache_gb), Frames(held_episodes, size)
    known = begun(out)  # then what the run began with is needed no more
    run = start(config, perception, frames, None if known else imagenet, team, None if known else config.initial)
    if known:
        restore_state(out / STATE, run)
    team.wait()
    rows = kept_rows(out / METRICS, run.step)
    with closing(Board(out / "tensorboard", team.leads, run.step)) as board:
        while run.step < config.steps and not stop(run.step):
            rows.append(_step(run, held, out, rows))
            board.add(rows[-1])
            progress(f"training, step {run.step}, loss {rows[-1]['loss']:.3f}", run.step / config.steps)
        if run.step == config.steps and team.leads and not stop(run.step):
            _finish(run, held, out, rows, board, progress)
    return out / MODEL


def begun(out: Path) -> bool:
    """Whether a run lies in this folder that can be taken up."""
    return (out / STATE).is_file()


def _looks_back(run: TrainingRun) -> bool:
    """Whether there are steps for blocks that look back, and such blocks."""
    return run.config.block_steps > 0 and run.network.span > 1


def _finish(run: TrainingRun, held: Frames, out: Path, rows: list[Row], board: Board, progress: Progress) -> None:
    """The blocks that look back learn alone, unless they did already. A network that somebody removed comes again."""
    last, there = run.config.steps + run.config.block_steps, (out / MODEL).is_file()
    if there and any(row["step"] == last for row in kept_rows(out / METRICS, last)):
        forget_features(out)
        return
    if not there:
        _write_rows(out, rows)  # else those of its blocks' lesson would speak for a network that had none yet
        validate(run, held, out / MODEL, run.context)
    if not _looks_back(run):
        return
    info = load_network(out / MODEL)[1]
    features = feature_table(run, info, out, progress)
    for step, loss in enumerate(learn_blocks(run, features), start=1):
        rows.append({"step": run.config.steps + step, "loss": _number(loss, run.config.steps + step)})
        board.add(rows[-1])
        progress(f"blocks, step {step}, loss {loss:.3f}", step / run.config.block_steps)
    run.network.to(run.team.device)
    rows[-1] |= validate(run, held, out / MODEL, run.network.span - 1)
    board.add(rows[-1])
    draw_curves(rows, out / CURVES)
    _write_rows(out, rows)
    forget_features(out)


def _number(loss: float, step: int) -> float:
    """The loss of a step. Raises ValueError where it is no number."""
    if not math.isfinite(loss):
        raise ValueError(f"found a loss of {loss} at step {step}, wanted a number: type a smaller --rate")
    return loss


def _step(run: TrainingRun, held: Frames, out: Path, rows: list[Row]) -> Row:
    """One step and what belongs after it; returns its row of the metrics."""
    config, began = run.config, time.perf_counter()
    row: Row = {"step": run.step + 1, "rate": learning_rate(run.step, config), "loss": _number(run.advance(), run.step)}
    row["windows_per_s"] = config.batch / (time.perf_counter() - began)
    last = run.step == config.steps
    if last or run.step % config.evaluate_every == 0:
        if run.team.leads:
            row |= validate(run, held, out / MODEL, run.context)
            draw_curves([*rows, row], out / CURVES)
        run.team.wait()
    if run.team.leads and (last or run.step % config.save_every == 0):
        _write_rows(out, [*rows, row])
        save_state(out / STATE, run)
    return row
