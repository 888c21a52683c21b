"""A training from a recording to a network on disk."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest

from caldrive.files import locked_folder
from caldrive.perception.dataset.config import AugmentationConfig
from caldrive.perception.dataset.frames import Frames
from caldrive.perception.evaluation.evaluate import evaluate
from caldrive.perception.network.checkpoint import load_network
from caldrive.perception.network.tensor_file import CheckpointError, read_tensors
from caldrive.perception.training.config import TRAININGS, TrainingConfig
from caldrive.perception.training.loop import read_frames
from caldrive.perception.training.train import train
from caldrive.recordings.folder import find_episodes, split
from caldrive.recordings.writer import EpisodeError
from tests.perception.data import HEIGHT, HISTORY, SCENARIO, SHORT, TINY, WIDTH, record


def test_learns_where_the_column_stands(folder: Path, tmp_path: Path) -> None:
    config = replace(
        SHORT,
        steps=140,
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
    assert (tmp_path / "curves.png").is_file()
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
        if label.startswith("training, step 8 "):
            raise KeyboardInterrupt

    model = train(HISTORY, folder, tmp_path, TINY)
    whole = model.read_bytes()
    model.unlink()
    with pytest.raises(KeyboardInterrupt):
        train(HISTORY, folder, tmp_path, TINY, progress=kill)
    assert not model.exists()
    assert train(HISTORY, folder, tmp_path, TINY).read_bytes() == whole


def test_only_frames_that_train_carry_semantic_images(tmp_path: Path) -> None:
    frames = read_frames(SHORT, TINY.image_size, record(tmp_path, n_frames=5, semantic=True))
    assert frames.training.has_semantics
    assert not frames.validation.has_semantics


@pytest.mark.parametrize("config", [SHORT, HISTORY], ids=["one stage", "two stages"])
def test_a_network_carries_its_name_when_it_is_finished_and_not_before(
    config: TrainingConfig, folder: Path, tmp_path: Path
) -> None:
    often = replace(config, evaluate_every=3)
    model = train(often, folder, tmp_path, TINY, stop=lambda step: step == 3)
    assert not model.exists()
    load_network(tmp_path / "unfinished.safetensors")
    with pytest.raises(
        CheckpointError, match=r"a training in .* that is not finished, .* type caldrive train as before"
    ):
        load_network(model)
    train(often, folder, tmp_path, TINY)
    load_network(model)
    assert not (tmp_path / "unfinished.safetensors").exists()


def test_a_training_has_as_many_steps_as_were_asked_for(folder: Path, tmp_path: Path) -> None:
    said = []
    config = TrainingConfig(
        steps=6, batch=4, history_batch=4, camera_check_steps=0, precision="fp32", validation_share=0.3
    )
    train(config, folder, tmp_path, TINY, progress=lambda label, share: said.append((label, share)))
    assert len((tmp_path / "metrics.jsonl").read_text().splitlines()) == 6
    assert (config.second_stage, TRAININGS["small"].second_stage, TRAININGS["paper"].second_stage) == (1, 3000, 0)
    assert said[-1][0].startswith("training, step 6 of 6, loss ")
    assert said[-1][1] == 1.0


def test_two_trainings_in_one_folder_at_once_are_refused(folder: Path, tmp_path: Path) -> None:
    with locked_folder(tmp_path), pytest.raises(ValueError, match="found another process at work"):
        train(SHORT, folder, tmp_path, TINY)
    assert list(tmp_path.iterdir()) == []


def test_without_an_episode_no_folder_is_made(tmp_path: Path) -> None:
    with pytest.raises(EpisodeError, match="caldrive collect"):
        train(SHORT, tmp_path / "none", tmp_path / "out", TINY)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("town", ["town02", "random:9000000"])
def test_what_was_seen_in_a_town_that_only_judges_trains_nothing(town: str, tmp_path: Path) -> None:
    data = record(tmp_path / "data", n_frames=8, scenario=replace(SCENARIO, town=town))
    with pytest.raises(ValueError, match=f"found {town} to learn from, wanted a"):
        train(SHORT, data, tmp_path / "out", TINY)
    assert not (tmp_path / "out").exists()
