"""The training of the segmentation network."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from caldrive.agents.modular_pipeline.checkpoint import load_segmentation
from caldrive.agents.modular_pipeline.config import PIPELINE_TRAININGS, PipelineConfig
from caldrive.agents.modular_pipeline.learner import sampler_of, train_pipeline
from caldrive.recordings.writer import EpisodeError
from tests.agents.modular_pipeline.test_segmenter import SMALL
from tests.perception.data import record

SHORT = PipelineConfig(
    steps=4, batch=6, warm_up=1, evaluate_every=100, save_every=2, precision="fp32", validation_share=0.3, device="cpu"
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return record(tmp_path_factory.mktemp("episodes"), semantic=True)


@pytest.fixture(autouse=True)
def _one_thread() -> None:
    torch.set_num_threads(1)


def test_a_training_leaves_a_network_with_its_figures(folder: Path, tmp_path: Path) -> None:
    network, info = load_segmentation(train_pipeline(SHORT, folder, tmp_path, SMALL))
    assert network.config == SMALL
    assert len(info.ranges) == 13
    assert {"loss", "junction/accuracy", "iou/road", "iou/lane_marking"} <= set(info.metrics)
    rows = [json.loads(line) for line in (tmp_path / "metrics.jsonl").read_text().splitlines()]
    assert rows[-1]["validation/iou/road"] == info.metrics["iou/road"]


def test_a_training_that_was_killed_ends_with_the_same_weights(folder: Path, tmp_path: Path) -> None:
    whole = train_pipeline(SHORT, folder, tmp_path / "whole", SMALL).read_bytes()
    path = train_pipeline(SHORT, folder, tmp_path / "killed", SMALL, stop=lambda step: step == 2)
    assert not path.exists()
    assert train_pipeline(SHORT, folder, tmp_path / "killed", SMALL).read_bytes() == whole


def test_a_recording_without_semantic_images_is_refused(tmp_path: Path) -> None:
    data = record(tmp_path / "data")
    with pytest.raises(EpisodeError, match="found no semantic images"):
        train_pipeline(SHORT, data, tmp_path / "out", SMALL)


def test_as_published_2500_frames_are_taken_from_all_of_the_recording() -> None:
    labels = (np.arange(100_000) % 10 == 0).astype(float)
    sampler = sampler_of(labels, PIPELINE_TRAININGS["published"])
    assert len(sampler.ids) == 2500
    assert np.diff(sampler.ids).max() <= 41
    assert not PIPELINE_TRAININGS["published"].augmentation.enabled


def test_frames_near_a_junction_come_as_often_as_the_others() -> None:
    labels = (np.arange(1000) < 100).astype(float)
    drawn = sampler_of(labels, replace(SHORT, balance=1.0)).draw(3, 4000)
    assert (drawn < 100).mean() == pytest.approx(0.5, abs=0.03)
    assert (sampler_of(labels, replace(SHORT, balance=0.0)).draw(3, 4000) < 100).mean() == pytest.approx(0.1, abs=0.03)


def test_settings_that_cannot_be_end_in_a_sentence() -> None:
    with pytest.raises(ValueError, match="--frames"):
        PipelineConfig(frames=0)
    with pytest.raises(ValueError, match="--junction-weight"):
        PipelineConfig(junction_weight=-1.0)
