"""Training from a folder of episodes to a network on disk, with its progress, its curves, and a way to go on."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from caldrive.affordances import SPECS
from caldrive.files import read_json, write_figure, write_whole
from caldrive.perception.network.checkpoint import (
    CheckpointError,
)

Row = dict[str, int | float]
MODEL, STATE, METRICS, CURVES = "model.safetensors", "state.safetensors", "metrics.jsonl", "curves.png"


def kept_rows(path: Path, step: int) -> list[Row]:
    """Rows of the metrics that a run taken up at this step will not write again. Raises CheckpointError where they are
    damaged."""
    lines = path.read_bytes().splitlines() if path.is_file() else []
    try:
        return [row for row in map(_row, lines) if row["step"] <= step]
    except ValueError as error:
        raise CheckpointError(f"{path} is damaged ({error}): remove the folder, or give another --out") from error


def _row(line: bytes) -> Row:
    row = read_json(line, Row)
    if missing := {"step", "loss"} - row.keys():
        raise ValueError(f"a row lacks {min(missing)}")
    return row


def _write_rows(out: Path, rows: list[Row]) -> None:
    write_whole(out / METRICS, "".join(json.dumps(row) + "\n" for row in rows).encode())


SMOOTH = 50  # steps that the loss is averaged over


class Board:
    """A run's figures for TensorBoard, where it is installed; elsewhere nothing happens."""

    def __init__(self, folder: Path, on: bool = True, step: int = 0) -> None:
        """step: the last one that is done; what is there of later ones is drawn no more."""
        self._writer: Any = None
        if on and find_spec("tensorboard") is not None:
            from torch.utils.tensorboard import SummaryWriter

            self._writer = SummaryWriter(str(folder), purge_step=step + 1)

    def add(self, row: Mapping[str, float]) -> None:
        """One step's row of the metrics."""
        if self._writer is not None:
            for name in row.keys() - {"step"}:
                self._writer.add_scalar(name, row[name], int(row["step"]))

    def close(self) -> None:
        """Write what is not written yet."""
        if self._writer is not None:
            self._writer.close()


def draw_curves(rows: Sequence[Mapping[str, float]], path: Path) -> None:
    """Writes a PNG of a run's metrics, a row a step with `step`, `loss` and now and then `validation/<figure>`."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(14, 6))
    figure.subplots_adjust(0.06, 0.08, 0.99, 0.94, wspace=0.22, hspace=0.32)  # "constrained" would take twice as long
    axes = figure.subplots(2, 4).ravel()
    step, loss = (np.array([row[name] for row in rows]) for name in ("step", "loss"))
    width = min(SMOOTH, len(rows))
    axes[0].plot(step[width - 1 :], np.convolve(loss, np.full(width, 1 / width), "valid"), color="#3b6ea5")
    axes[0].set(title=f"training loss, mean of {width} steps", yscale="log")
    shown = ["loss", *(f"{spec.name}/{'iou' if spec.discrete else 'mae'}" for spec in SPECS)]
    for ax, name in zip(axes[1:], shown, strict=True):
        found = [(row["step"], row[f"validation/{name}"]) for row in rows if f"validation/{name}" in row]
        ax.plot([at for at, _ in found], [value for _, value in found], "o-", color="#c8782d")
        ax.set(title=f"validation, {name.replace('_', ' ')}", xlabel="step")
    write_figure(path, figure)
