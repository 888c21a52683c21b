"""A training's folder: its state, its network, and its metrics as lines, curves and figures for TensorBoard."""

from __future__ import annotations

import json
import shutil
from collections.abc import Mapping, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from caldrive.files import read_json, write_figure, write_whole
from caldrive.perception.network.tensor_file import UNFINISHED, CheckpointError

Row = dict[str, int | float]  # a step's metrics
SMOOTHED_STEPS = 50  # that the loss is averaged over in its curve


class TrainingFolder:
    """The folder of a run: state.safetensors, from which it goes on, model.safetensors once it is finished and
    unfinished.safetensors until then, metrics.jsonl with a row a step, curves.png, and what only lies there for a time.

    rows: the metrics so far. Only the main one of several processes writes metrics.
    """

    def __init__(self, path: Path, is_main: bool = True) -> None:
        self.state, self.model = path / "state.safetensors", path / "model.safetensors"
        self.unfinished = path / UNFINISHED
        self.metrics, self.curves = path / "metrics.jsonl", path / "curves.png"
        self.features, self._tensorboard = path / "features", path / "tensorboard"
        self.rows: list[Row] = []
        self._writer: Any = None
        self._is_main = is_main

    @property
    def has_state(self) -> bool:
        """Whether a run lies here that can be resumed."""
        return self.state.is_file()

    def open_metrics(self, step: int) -> None:
        """Goes on with the metrics after a step. Raises CheckpointError where they are damaged."""
        self.rows = self.saved_rows(step)
        if self._is_main and find_spec("tensorboard") is not None:
            from torch.utils.tensorboard import SummaryWriter

            self._writer = SummaryWriter(str(self._tensorboard), purge_step=step + 1)

    def saved_rows(self, step: int) -> list[Row]:
        """The rows on disk up to a step. Raises CheckpointError where they are damaged."""
        lines = self.metrics.read_bytes().splitlines() if self.metrics.is_file() else []
        try:
            return [row for row in map(_row, lines) if row["step"] <= step]
        except ValueError as error:
            raise CheckpointError(
                f"found that {self.metrics} is damaged ({error}), wanted a row of metrics a step: "
                "remove the folder, or give another --out"
            ) from error

    def add(self, row: Row) -> None:
        """Adds a step's metrics."""
        self.rows.append(row)
        self._show(row)

    def add_to_last(self, figures: Mapping[str, float]) -> None:
        """Adds figures to the last step's metrics."""
        self.rows[-1] |= figures
        self._show({**figures, "step": self.rows[-1]["step"]})

    def _show(self, row: Mapping[str, float]) -> None:
        """One step's figures in TensorBoard, where it is installed."""
        if self._writer is not None:
            for name in row.keys() - {"step"}:
                self._writer.add_scalar(name, row[name], int(row["step"]))

    def write_metrics(self) -> None:
        """Writes all rows so far."""
        write_whole(self.metrics, "".join(json.dumps(row) + "\n" for row in self.rows).encode())

    def has_finished(self, step: int) -> bool:
        """Whether the run's network is there, and its metrics up to its last step."""
        is_whole = self.model.is_file() and not self.unfinished.is_file()
        return is_whole and any(row["step"] == step for row in self.saved_rows(step))

    def remove_unfinished(self) -> None:
        """Frees the disk of what only an unfinished run needs."""
        shutil.rmtree(self.features, ignore_errors=True)
        self.unfinished.unlink(missing_ok=True)

    def draw_curves(self, figures: Sequence[str]) -> None:
        """Draws the metrics anew. figures: names of those that a validation has."""
        draw_curves(self.rows, figures, self.curves)

    def close(self) -> None:
        """Writes what TensorBoard has not been given yet."""
        if self._writer is not None:
            self._writer.close()


def _row(line: bytes) -> Row:
    row = read_json(line, Row)
    if missing := {"step", "loss"} - row.keys():
        raise ValueError(f"a row lacks {min(missing)}")
    return row


def draw_curves(rows: Sequence[Mapping[str, float]], figures: Sequence[str], path: Path) -> None:
    """Writes a PNG of a run's metrics, a row a step with `step`, `loss` and now and then `validation/<figure>`."""
    from matplotlib.figure import Figure

    figure, columns = Figure(figsize=(14, 6)), (len(figures) + 2) // 2
    figure.subplots_adjust(0.06, 0.08, 0.99, 0.94, wspace=0.22, hspace=0.32)  # "constrained" would take twice as long
    axes = figure.subplots(2, columns, squeeze=False).ravel()
    step, loss = (np.array([row[name] for row in rows]) for name in ("step", "loss"))
    width = min(SMOOTHED_STEPS, len(rows))
    axes[0].plot(step[width - 1 :], np.convolve(loss, np.full(width, 1 / width), "valid"), color="#3b6ea5")
    axes[0].set(title=f"training loss, mean of {width} steps", yscale="log")
    for ax, name in zip(axes[1:], figures, strict=False):
        validated = [row for row in rows if f"validation/{name}" in row]
        steps, values = ([row[key] for row in validated] for key in ("step", f"validation/{name}"))
        ax.plot(steps, values, "o-", color="#c8782d")
        ax.set(title=f"validation, {name.replace('_', ' ')}", xlabel="step")
    for ax in axes[1 + len(figures) :]:
        ax.remove()
    write_figure(path, figure)
