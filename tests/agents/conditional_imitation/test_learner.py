"""The training of conditional imitation learning."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest
import torch

from caldrive.agents.conditional_imitation import learner
from caldrive.agents.conditional_imitation.checkpoint import load_imitation
from caldrive.agents.conditional_imitation.config import ImitationWeights
from caldrive.agents.conditional_imitation.learner import imitation_loss, train_imitation
from caldrive.perception.dataset.config import AugmentationConfig, RecolourConfig
from caldrive.perception.network.tensor_file import CheckpointError
from caldrive.perception.training import folder as folder_of_training
from tests.agents.conditional_imitation.data import SHORT, SMALL
from tests.perception.data import record


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return record(tmp_path_factory.mktemp("episodes"))


@pytest.fixture(autouse=True)
def _one_thread_and_no_drawing(monkeypatch: pytest.MonkeyPatch) -> None:
    """Half of a tiny training's time would go into its curves, and into the ranges of its integers."""
    torch.set_num_threads(1)
    monkeypatch.setattr(folder_of_training, "draw_curves", lambda rows, figures, path: path.write_bytes(b"curves"))
    monkeypatch.setattr(learner, "RANGE_FRAMES", 8)


def test_each_error_counts_what_its_weight_says() -> None:
    controls, speed = torch.zeros(2, 3), torch.zeros(2)
    outputs = (torch.tensor([[0.2, 0.0, 0.0], [0.0, 0.4, 0.6]]), torch.tensor([2.5, 0.0]))
    weights = ImitationWeights(steer=1.0, throttle=10.0, brake=100.0, speed=1000.0)
    wanted = 0.5 * (0.04 + 10 * 0.16 + 100 * 0.36 + 1000 * 0.1**2)
    assert float(imitation_loss(outputs, controls, speed, weights)) == pytest.approx(wanted, rel=1e-5)


def test_a_training_learns_what_the_driver_did(folder: Path, tmp_path: Path) -> None:
    config = replace(SHORT, steps=90, learning_rate=3e-3, save_every=1000)
    _, info = load_imitation(train_imitation(config, folder, tmp_path, SMALL))
    assert info.metrics["throttle/mae"] < 0.1  # it is 0.5 throughout, and a new network says 0.1
    assert info.metrics["speed/mae"] < 2.5  # m/s, of 5
    assert info.data["train_frames"] > info.data["validation_frames"] > 0
    rows = [json.loads(line) for line in (tmp_path / "metrics.jsonl").read_text().splitlines()]
    assert rows[-1]["validation/steer/mae"] == info.metrics["steer/mae"]
    assert (tmp_path / "curves.png").is_file()


@pytest.mark.parametrize("stop", [2, 5])
def test_a_training_that_was_killed_ends_with_the_same_weights(stop: int, folder: Path, tmp_path: Path) -> None:
    whole = train_imitation(SHORT, folder, tmp_path / "whole", SMALL).read_bytes()
    path = train_imitation(SHORT, folder, tmp_path / "killed", SMALL, stop=lambda step: step == stop)
    assert not path.exists()
    assert train_imitation(SHORT, folder, tmp_path / "killed", SMALL).read_bytes() == whole


def test_other_settings_are_refused_where_a_training_goes_on(folder: Path, tmp_path: Path) -> None:
    train_imitation(SHORT, folder, tmp_path, SMALL, stop=lambda step: step == 2)
    with pytest.raises(CheckpointError, match=r"with weights.steer 0.4275, wanted 1.0: type the same settings"):
        train_imitation(replace(SHORT, weights=ImitationWeights(steer=1.0)), folder, tmp_path, SMALL)
    with pytest.raises(CheckpointError, match=r"with network.nodes 16, wanted 17"):
        train_imitation(SHORT, folder, tmp_path, replace(SMALL, nodes=17))


def test_cals_own_augmentation_may_take_the_place_of_the_published_one(tmp_path: Path) -> None:
    data = record(tmp_path / "data", semantic=True)
    config = replace(
        SHORT, steps=1, published_augmentation=False, augmentation=AugmentationConfig(), recolour=RecolourConfig()
    )
    one = train_imitation(config, data, tmp_path / "one", SMALL).read_bytes()
    plain = replace(config, recolour=RecolourConfig(enabled=False))
    assert train_imitation(plain, data, tmp_path / "two", SMALL).read_bytes() != one
