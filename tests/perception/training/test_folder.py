"""What lies in the folder of a training."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from PIL import Image

from caldrive.perception.network.tensor_file import CheckpointError
from caldrive.perception.training.folder import draw_curves
from caldrive.perception.training.train import train
from tests.perception.data import SHORT, TINY


def test_damaged_metrics_are_named(folder: Path, tmp_path: Path) -> None:
    train(SHORT, folder, tmp_path, TINY, stop=lambda step: step == 2)
    for content in ("{", "[]", '{"loss": 1}', '{"step": 1}', '{"step": "a"}'):
        (tmp_path / "metrics.jsonl").write_text(content + "\n")
        with pytest.raises(CheckpointError, match=r"metrics\.jsonl is damaged"):
            train(SHORT, folder, tmp_path, TINY)


def test_tensorboard_finds_the_figures(folder: Path, tmp_path: Path) -> None:
    accumulator = pytest.importorskip("tensorboard.backend.event_processing.event_accumulator")
    train(SHORT, folder, tmp_path, TINY)
    events = accumulator.EventAccumulator(str(tmp_path / "tensorboard")).Reload()
    rows = [json.loads(line) for line in (tmp_path / "metrics.jsonl").read_text().splitlines()]
    shown = {one.step: one.value for one in events.Scalars("loss")}
    assert shown == pytest.approx({row["step"]: row["loss"] for row in rows})


def test_curves_are_drawn_where_some_steps_were_validated(tmp_path: Path) -> None:
    rows: list[dict[str, float]] = [{"step": step, "loss": 1 / step} for step in range(1, 61)]
    rows[-1] |= {"validation/loss": 0.5, "validation/red_light/iou": 0.9}
    draw_curves(rows, ("loss", "red_light/iou"), tmp_path / "curves.png")
    with Image.open(tmp_path / "curves.png") as picture:
        assert picture.size > (1000, 400)
