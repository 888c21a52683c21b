"""A training from a recording to a network on disk."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest

from caldrive.perception.dataset.config import AugmentationConfig
from caldrive.perception.dataset.frames import Frames
from caldrive.perception.evaluation.evaluate import evaluate
from caldrive.perception.network.checkpoint import load_network, read_tensors
from caldrive.perception.training.config import TRAININGS, TrainingConfig
from caldrive.perception.training.train import train
from caldrive.recordings.folder import find_episodes, split
from tests.perception.data import HEIGHT, HISTORY, SHORT, TINY, WIDTH, record


def test_learns_where_the_column_stands(folder: Path, tmp_path: Path) -> None:
    config = replace(
        SHORT,
        steps=200,
        batch=6,
        learning_rate=2e-3,
        save_every=1000,
        augmentation=AugmentationConfig(enabled=False),
        balance=0.0,
    )
    network, info = load_network(train(config, folder, tmp_path, TINY))
    assert info.metrics["center_distance/mae"] < 0.35  # the column wanders evenly over +-1 m: guessing 0 gives 0.5
    assert info.metrics["hazard_stop/iou"] > 0.6  # never seeing one gives 0.43
    frames = Frames(find_episodes(folder), (HEIGHT, WIDTH))
    assert evaluate(network, frames, "fp32")["center_distance/mae"] < 0.35


def test_the_papers_training_adds_no_segmentation_and_no_alternative_commands(tmp_path: Path) -> None:
    data = record(tmp_path / "data", semantic=True)
    paper = replace(
        TRAININGS["paper"], steps=2, batch=2, window=2, backbone_chunk=3, validation_share=0.3, precision="fp32",
        device="cpu", imagenet="none",
    )  # fmt: skip
    path = train(paper, data, tmp_path / "out", replace(TINY, batch_norm=False))
    state = read_tensors(path.parent / "state.safetensors")[0]
    assert not any("segmentation" in name for name in state)
    assert load_network(path)[1].training["alternative_share"] == 0.0


def test_validation_metrics_are_written_and_kept_with_the_network(folder: Path, tmp_path: Path) -> None:
    model = train(replace(SHORT, evaluate_every=3), folder, tmp_path, TINY)
    rows = [json.loads(line) for line in (tmp_path / "metrics.jsonl").read_text().splitlines()]
    assert [row["step"] for row in rows if "validation/loss" in row] == [3, 6]
    assert (tmp_path / "curves.png").read_bytes().startswith(b"\x89PNG")
    network, info = load_network(model)
    held = split(find_episodes(folder), SHORT.validation_share, SHORT.seed)[1]
    assert evaluate(network, Frames(held, (HEIGHT, WIDTH)), "fp32") == info.metrics  # what is stored was measured
    assert info.metrics["loss"] == rows[-1]["validation/loss"]
    assert info.data["validation_frames"] == 80


@pytest.mark.parametrize("config", [SHORT, HISTORY], ids=["one stage", "two stages"])
def test_a_network_that_was_removed_comes_again(config: TrainingConfig, folder: Path, tmp_path: Path) -> None:
    model = train(config, folder, tmp_path, TINY)
    whole = model.read_bytes()
    model.unlink()
    assert train(config, folder, tmp_path, TINY).read_bytes() == whole


def test_a_network_that_was_removed_and_whose_blocks_were_killed_comes_again(folder: Path, tmp_path: Path) -> None:
    def kill(label: str, share: float) -> None:
        if label.startswith("blocks, step 2"):
            raise KeyboardInterrupt

    model = train(HISTORY, folder, tmp_path, TINY)
    whole = model.read_bytes()
    model.unlink()
    with pytest.raises(KeyboardInterrupt):
        train(HISTORY, folder, tmp_path, TINY, progress=kill)
    assert model.read_bytes() != whole
    assert train(HISTORY, folder, tmp_path, TINY).read_bytes() == whole
