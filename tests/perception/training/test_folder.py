"""What lies in the folder of a training."""

from __future__ import annotations

from importlib.util import find_spec
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


def test_tensorboard_finds_the_figures_where_it_is_installed(folder: Path, tmp_path: Path) -> None:
    train(SHORT, folder, tmp_path, TINY)
    assert (tmp_path / "tensorboard").is_dir() == (find_spec("tensorboard") is not None)
