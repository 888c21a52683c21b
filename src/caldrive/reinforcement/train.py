"""Training by reinforcement, from settings to a policy on disk, and a way to go on after a stop."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from functools import partial
from pathlib import Path

import numpy as np

from caldrive.agents.reinforcement.checkpoint import PolicyInfo, encoder_info, save_policy
from caldrive.agents.reinforcement.encoder import Encoder, load_encoder
from caldrive.agents.rows import model_path
from caldrive.files import locked_folder, write_figure
from caldrive.perception.training.folder import TrainingFolder
from caldrive.progress import Progress, silent
from caldrive.reinforcement.config import ReinforcementConfig
from caldrive.reinforcement.environment import env_config, make_learning_env, policy_config
from caldrive.reinforcement.run import LearningRun
from caldrive.reinforcement.state import digests, plain_settings, restore_state, save_state

SMOOTHED_UPDATES = 20  # that curves are averaged over


def train_rl(
    config: ReinforcementConfig,
    out: Path | str,
    progress: Progress = silent,
    stop: Callable[[int], bool] = lambda update: False,
) -> Path:
    """Train a policy by reinforcement, and return the finished one's path, `out`/model.safetensors.

    In `out` lie also state.safetensors, from which the same call resumes, metrics.jsonl with a row an update,
    curves.png that draws them, and `checkpoints` with the policies on the way; until it is finished the policy is
    called unfinished.safetensors. `stop` may end the run early after an update. Raises ValueError or FileNotFoundError
    for settings that cannot be, and ValueError where another process works in `out`.
    """
    encoder = load_encoder(model_path(config.encoder, "mp", "--encoder")) if config.sees == "features" else None
    env_config(config, encoder)
    folder = TrainingFolder(Path(out))
    with locked_folder(Path(out)):
        run = LearningRun(config, policy_config(config, encoder), partial(make_learning_env, config, encoder))
        with closing(run), closing(folder):
            if folder.has_state:
                restore_state(folder.state, run)
            folder.open_metrics(run.steps)
            _train(run, encoder, folder, progress, stop)
    return folder.model


def _train(
    run: LearningRun, encoder: Encoder | None, folder: TrainingFolder, progress: Progress, stop: Callable[[int], bool]
) -> None:
    """Updates to the end, unless somebody stops them."""
    updates = run.config.updates
    while run.update < updates and not stop(run.update):
        began = time.perf_counter()
        row = run.advance()
        row["steps_per_s"] = run.config.update_steps / (time.perf_counter() - began)
        folder.add(row)
        if run.at_save_point or run.update == updates:
            _save(run, encoder, folder)
        task = run.config.tasks[run.curriculum.level]
        progress(f"training, {run.steps} decisions, {task}, {row['reward_per_step']:.2f} a step", run.update / updates)
    if run.update == updates:
        _write_policy(folder.model, run, encoder)
        folder.unfinished.unlink(missing_ok=True)


def _save(run: LearningRun, encoder: Encoder | None, folder: TrainingFolder) -> None:
    """Writes all that a run leaves; its state last, as a run that is killed before goes on from the one before."""
    folder.write_metrics()
    draw_curves(folder.rows, folder.curves)
    if (percent := _checkpoint(run)) is not None:
        _write_policy(folder.model.parent / "checkpoints" / f"{percent:03}.safetensors", run, encoder)
    _write_policy(folder.unfinished, run, encoder)
    save_state(folder.state, run)


def _write_policy(path: Path, run: LearningRun, encoder: Encoder | None) -> None:
    """The policy as it is, with what is known of it."""
    info = PolicyInfo(
        run.policy, plain_settings(run.config), run.config.seed, run.steps,
        encoder_info(encoder) if encoder else None, digests(run.config).get("perception"),
    )  # fmt: skip
    save_policy(path, run.learning_policy.actor, info, encoder)


def _checkpoint(run: LearningRun) -> int | None:
    """The checkpoint that has been reached since the last save, in percent of the run; None for none."""
    config, every = run.config, run.config.save_every
    before = (run.update - 1) // every * every
    parts = [update * config.checkpoints // config.updates for update in (before, run.update)]
    return 100 * parts[1] // config.checkpoints if parts[1] > parts[0] else None


def draw_curves(rows: Sequence[Mapping[str, float]], path: Path) -> None:
    """Writes a PNG of a training's metrics, by thousand decisions, each the mean of some updates."""
    from matplotlib.figure import Figure

    names = ("reward_per_step", "completion", "length", "level", "entropy", "kl", "explained_variance")
    figure = Figure(figsize=(14, 6))
    figure.subplots_adjust(0.06, 0.08, 0.99, 0.94, wspace=0.22, hspace=0.32)
    axes = figure.subplots(2, 4).ravel()
    for task in dict.fromkeys(name for row in rows for name in row if name.startswith("success/")):
        axes[0].plot(*_smooth(rows, task), label=task.removeprefix("success/"))
    axes[0].set(title="goals reached", ylim=(0, 1))
    if axes[0].lines:
        axes[0].legend()
    for ax, name in zip(axes[1:], names, strict=True):
        ax.plot(*_smooth(rows, name), color="#3b6ea5")
        ax.set(title=name.replace("_", " "), xlabel="thousand decisions")
    write_figure(path, figure)


def _smooth(rows: Sequence[Mapping[str, float]], name: str) -> tuple[np.ndarray, np.ndarray]:
    """Thousand decisions, and a figure's mean over some updates, where it is there."""
    points = np.array([(row["step"] / 1000, row[name]) for row in rows if name in row]).reshape(-1, 2)
    if not len(points):
        return points[:, 0], points[:, 1]
    width = max(1, min(SMOOTHED_UPDATES, len(points)))
    return points[width - 1 :, 0], np.convolve(points[:, 1], np.full(width, 1 / width), "valid")
