"""A training that was stopped or killed goes on to the same weights, and no other one is taken up."""

from __future__ import annotations

import json
import shutil
import time
from dataclasses import replace
from multiprocessing import get_context
from pathlib import Path
from signal import SIGKILL
from typing import Any

import pytest
import torch

from caldrive.perception.dataset.config import AugmentationConfig, RecolourConfig
from caldrive.perception.network.checkpoint import load_network
from caldrive.perception.network.tensor_file import CheckpointError, read_tensors, write_tensors
from caldrive.perception.training.train import train
from tests.perception.data import SHORT, TINY, record


@pytest.fixture(scope="module")
def whole(folder: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The network of a training that nobody stopped."""
    return train(SHORT, folder, tmp_path_factory.mktemp("whole"), TINY)


@pytest.fixture(scope="module")
def stopped_once(folder: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("stopped")
    train(SHORT, folder, out, TINY, stop=lambda step: step == 2)
    return out


@pytest.fixture
def stopped(stopped_once: Path, tmp_path: Path) -> Path:
    """The folder of a training that was stopped after its second step."""
    return Path(shutil.copytree(stopped_once, tmp_path / "stopped"))


def test_a_killed_run_resumes_to_the_same_weights(whole: Path, folder: Path, tmp_path: Path) -> None:
    train(SHORT, folder, tmp_path / "killed", TINY, stop=lambda step: step == 3)
    assert read_tensors(tmp_path / "killed" / "state.safetensors")[1]["step"] == 2
    resumed = train(SHORT, folder, tmp_path / "killed", TINY)
    assert resumed.read_bytes() == whole.read_bytes()
    rows = [
        [json.loads(line) for line in (p.parent / "metrics.jsonl").read_text().splitlines()] for p in (whole, resumed)
    ]
    assert [r["loss"] for r in rows[0]] == [r["loss"] for r in rows[1]]
    assert [r["step"] for r in rows[1]] == [1, 2, 3, 4, 5, 6]


def test_a_killed_run_on_semantic_images_resumes_to_the_same_weights(tmp_path: Path) -> None:
    semantic = record(tmp_path / "seen", semantic=True)
    whole = train(SHORT, semantic, tmp_path / "whole", TINY)
    train(SHORT, semantic, tmp_path / "killed", TINY, stop=lambda step: step == 3)
    assert train(SHORT, semantic, tmp_path / "killed", TINY).read_bytes() == whole.read_bytes()
    train(SHORT, semantic, tmp_path / "other", TINY, stop=lambda step: step == 2)
    with pytest.raises(CheckpointError, match="other tasks"):
        train(SHORT, record(tmp_path / "unseen"), tmp_path / "other", TINY)


def test_a_run_is_not_taken_up_by_another_number_of_processes(stopped: Path, folder: Path) -> None:
    tensors, header = read_tensors(stopped / "state.safetensors")
    write_tensors(stopped / "state.safetensors", tensors, header | {"processes": 4})
    with pytest.raises(CheckpointError, match="a run of 4 processes, wanted 1"):
        train(SHORT, folder, stopped, TINY)


def test_what_the_weights_do_not_depend_on_may_change_under_way(whole: Path, folder: Path, tmp_path: Path) -> None:
    train(SHORT, folder, tmp_path / "killed", TINY, stop=lambda step: step == 4)
    free = replace(SHORT, save_every=3, evaluate_every=5, cache_gb=0.0)
    networks = (load_network(train(free, folder, tmp_path / "killed", TINY)), load_network(whole))
    weights = [network.state_dict() for network, _ in networks]
    assert all(torch.equal(weights[0][name], weights[1][name]) for name in weights[1])


def test_a_state_of_other_settings_is_not_taken_up(stopped: Path, folder: Path) -> None:
    with pytest.raises(CheckpointError, match=r"run with learning_rate 0\.001, wanted 1\.0"):
        train(replace(SHORT, learning_rate=1.0), folder, stopped, TINY)
    with pytest.raises(CheckpointError, match=r"run with augmentation\.blur 1\.2, wanted 3\.0"):
        train(replace(SHORT, augmentation=AugmentationConfig(blur=3.0)), folder, stopped, TINY)
    with pytest.raises(CheckpointError, match=r"run with recolour\.enabled True, wanted False"):
        train(replace(SHORT, recolour=RecolourConfig(enabled=False)), folder, stopped, TINY)
    with pytest.raises(CheckpointError, match=r"run with network\.red_light\.nodes 8, wanted 9"):
        train(SHORT, folder, stopped, replace(TINY, red_light=replace(TINY.red_light, nodes=9)))


def test_a_state_of_other_episodes_is_not_taken_up(stopped: Path, tmp_path: Path) -> None:
    record(tmp_path / "more", n_episodes=5)
    with pytest.raises(CheckpointError, match="other episodes"):
        train(SHORT, tmp_path / "more", stopped, TINY)


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"step": -1}, "is damaged"),
        ({"step": 7}, "is damaged"),
        ({"step": None}, "is damaged"),
        ({"training": 3}, "is damaged"),
        ({"kind": "network"}, "a network, wanted a training's state"),
    ],
    ids=str,
)
def test_a_damaged_state_is_not_taken_up(change: dict[str, Any], sentence: str, stopped: Path, folder: Path) -> None:
    tensors, header = read_tensors(stopped / "state.safetensors")
    write_tensors(stopped / "state.safetensors", tensors, header | change)
    with pytest.raises(CheckpointError, match=sentence):
        train(SHORT, folder, stopped, TINY)


@pytest.mark.parametrize("part", ["optimizer", "optimizer.3.exp_avg", "model."])
def test_a_state_without_one_of_its_parts_is_not_taken_up(part: str, stopped: Path, folder: Path) -> None:
    tensors, header = read_tensors(stopped / "state.safetensors")
    rest = {name: value for name, value in tensors.items() if not name.startswith(part)}
    write_tensors(stopped / "state.safetensors", rest, header)
    with pytest.raises(CheckpointError, match=r"without all of the optimizer|other tasks"):
        train(SHORT, folder, stopped, TINY)


def _train_slowly(data: Path, out: Path) -> None:
    torch.set_num_threads(1)

    def slow(step: int) -> bool:
        time.sleep(0.2 if step > 2 else 0.0)
        return False

    train(SHORT, data, out, TINY, stop=slow)


def test_a_training_killed_at_any_moment_resumes_to_the_same_weights(whole: Path, folder: Path, tmp_path: Path) -> None:
    killed = tmp_path / "killed"
    process = get_context("spawn").Process(target=_train_slowly, args=(folder, killed))
    process.start()
    while not (killed / "state.safetensors").is_file() and process.is_alive():
        time.sleep(0.02)
    process.kill()
    process.join()
    assert process.exitcode == -SIGKILL
    assert not (killed / "model.safetensors").exists()
    assert train(SHORT, folder, killed, TINY).read_bytes() == whole.read_bytes()
