"""What lies in the folder of a training."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from caldrive.perception.network.checkpoint import CheckpointError
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
