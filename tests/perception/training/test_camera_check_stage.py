from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from caldrive.perception.dataset.frames import Frames
from caldrive.perception.images import normalise, to_float
from caldrive.perception.network.camera_check import (
    MOST_EVIDENCE,
    REASONS,
    CameraCheck,
    add_camera_check,
    averaged,
    evidence,
    load_camera_check,
)
from caldrive.perception.network.checkpoint import CheckpointInfo, load_network, save_network
from caldrive.perception.network.network import Network
from caldrive.perception.network.tensor_file import CheckpointError, read_tensors, write_tensors
from caldrive.perception.training.camera_check_stage import (
    BATCH,
    LEAST,
    evidence_thresholds,
    faulty_batch,
    train_camera_check,
)
from caldrive.perception.training.train import train
from caldrive.recordings.reader import read_episode
from tests.perception.data import HEIGHT, SHORT, TINY, WIDTH, record


@pytest.fixture(scope="module")
def frames(tmp_path_factory: pytest.TempPathFactory) -> Frames:
    folder = record(tmp_path_factory.mktemp("recording"), n_episodes=2)
    return Frames([read_episode(path) for path in sorted(folder.glob("*.parquet"))], (HEIGHT, WIDTH))


def test_half_of_a_batch_is_faulty_and_each_step_is_its_own(frames: Frames) -> None:
    images, number = faulty_batch(frames, 0, seed=1)
    again, other = faulty_batch(frames, 0, seed=1)[0], faulty_batch(frames, 1, seed=1)[0]
    assert images.shape == (BATCH, HEIGHT, WIDTH, 3)
    assert np.count_nonzero(number) == BATCH // 2
    assert number.max() <= len(REASONS)
    assert np.array_equal(images, again)
    assert not np.array_equal(images, other)


def test_the_check_learns_to_tell_noise_from_a_picture(frames: Frames) -> None:
    check = train_camera_check(frames, 40, seed=0)
    images = frames.images(np.arange(20))
    noise = np.random.default_rng(0).integers(0, 256, images.shape, dtype=np.uint8)
    with torch.no_grad():
        fine, noisy = (evidence(check(normalise(to_float(some))).numpy())[:, 0].mean() for some in (images, noise))
    assert noisy - fine > 0.5
    thresholds = evidence_thresholds(check, frames)
    assert len(thresholds) == len(REASONS)
    assert min(thresholds) >= LEAST


def test_the_same_seed_gives_the_same_check(frames: Frames) -> None:
    first, second = (train_camera_check(frames, 2, seed=3).state_dict() for _ in range(2))
    assert all(torch.equal(first[name], second[name]) for name in first)


def network_file(folder: Path) -> Path:
    torch.manual_seed(0)
    path = folder / "model.safetensors"
    save_network(path, Network(TINY), CheckpointInfo(TINY))
    return path


def test_a_networks_file_keeps_its_check_and_the_network_stays_the_same(tmp_path: Path) -> None:
    path, check = network_file(tmp_path), CameraCheck((HEIGHT, WIDTH)).eval()
    before = load_network(path)[0].state_dict()
    assert load_camera_check(path) is None
    for threshold in (5.0, 6.5):  # the second one replaces the first
        add_camera_check(path, check, [threshold] * len(REASONS))
    loaded = load_camera_check(path)
    assert loaded is not None
    assert loaded[1] == (6.5,) * len(REASONS)
    image = normalise(to_float(np.random.default_rng(0).integers(0, 256, (1, HEIGHT, WIDTH, 3), dtype=np.uint8)))
    torch.testing.assert_close(loaded[0](image), check(image), rtol=0, atol=0.01)
    after = load_network(path)[0].state_dict()
    assert all(torch.equal(before[name], after[name]) for name in before)


@pytest.mark.parametrize("what", ["thresholds", "shape", "nan", "missing"])
def test_a_check_that_cannot_be_is_named(tmp_path: Path, what: str) -> None:
    path = network_file(tmp_path)
    add_camera_check(path, CameraCheck((HEIGHT, WIDTH)), [5.0] * len(REASONS))
    tensors, header = read_tensors(path)
    name = "camera_check.head.0.weight"
    match what:
        case "thresholds":
            header["camera_check"] = {"blurred": "high"}
        case "shape":
            tensors[name] = tensors[name][:1]
        case "nan":
            tensors[name] = tensors[name] * float("nan")
        case _:
            del tensors[name]
    write_tensors(path, tensors, header)
    with pytest.raises(CheckpointError, match=r"camera check that does not fit this caldrive, wanted"):
        load_camera_check(path)


def test_the_evidence_is_within_what_one_image_may_count() -> None:
    outputs = np.array([[0.0, 1.0, 70.0, *[-50.0] * (len(REASONS) - 2)]], np.float32)
    assert evidence(outputs)[0].tolist() == [1.0, MOST_EVIDENCE, *[-MOST_EVIDENCE] * (len(REASONS) - 2)]


def test_evidence_is_averaged_over_each_reasons_window_and_missing_frames_count_nothing() -> None:
    odds = np.ones((80, len(REASONS)))
    odds[:-10] = 5.0
    noise, mirrored = averaged(odds)[:2]
    assert (noise, mirrored) == (1.0, pytest.approx((50 * 5 + 10) / 60))
    assert averaged(odds[-5:])[0] == 0.5


def test_a_training_that_was_stopped_before_its_camera_check_goes_on_with_it(tmp_path: Path) -> None:
    folder, config = record(tmp_path / "recording"), replace(SHORT, camera_check_steps=2)
    model = train(config, folder, tmp_path / "training", TINY)
    content = model.read_bytes()
    tensors, header = read_tensors(model)
    del header["camera_check"]
    write_tensors(model, {k: v for k, v in tensors.items() if not k.startswith("camera_check.")}, header)
    assert load_camera_check(model) is None
    for _ in range(2):  # the second time there is nothing left to do
        assert train(config, folder, tmp_path / "training", TINY).read_bytes() == content
    loaded = load_camera_check(model)
    assert loaded is not None
    assert len(loaded[1]) == len(REASONS)
