"""The second stage: temporal blocks learn on features of a finished backbone, with history, and stopped anywhere."""

from __future__ import annotations

import json
import math
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from caldrive.affordances import SPECS
from caldrive.perception.dataset.config import AugmentationConfig
from caldrive.perception.dataset.frames import Frames
from caldrive.perception.evaluation.evaluate import evaluate
from caldrive.perception.images import normalise, to_float
from caldrive.perception.inference.engines import backbone_engine
from caldrive.perception.network.checkpoint import load_network
from caldrive.perception.network.config import BlockConfig
from caldrive.perception.network.network import Network
from caldrive.perception.network.tensor_file import write_tensors
from caldrive.perception.training import history_stage
from caldrive.perception.training.train import train
from caldrive.recordings.folder import find_episodes, split
from tests.perception.data import HEIGHT, HISTORY, SHORT, TINY, WIDTH


@pytest.fixture(scope="module")
def whole(folder: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The network of a training that nobody stopped."""
    return train(HISTORY, folder, tmp_path_factory.mktemp("whole"), TINY)


@pytest.fixture
def finished(whole: Path, tmp_path: Path) -> Path:
    """A copy of its folder."""
    return Path(shutil.copytree(whole.parent, tmp_path / "finished"))


def test_the_blocks_learn_and_the_backbone_stays_as_it_is(folder: Path, tmp_path: Path) -> None:
    long = replace(
        HISTORY, steps=66, history_steps=60, learning_rate=3e-3, augmentation=AugmentationConfig(enabled=False)
    )
    before = load_network(train(replace(long, steps=6, history_steps=0), folder, tmp_path / "before", TINY))[0]
    after, info = load_network(train(long, folder, tmp_path / "after", TINY))
    rows = [json.loads(line) for line in (tmp_path / "after" / "metrics.jsonl").read_text().splitlines()]
    assert [row["step"] for row in rows] == list(range(1, 67))
    assert np.mean([row["loss"] for row in rows[-10:]]) < 0.8 * np.mean([row["loss"] for row in rows[6:16]])
    assert rows[-1]["validation/loss"] == info.metrics["loss"]
    assert before.config == after.config
    assert not (tmp_path / "after" / "features").exists()


def test_only_temporal_blocks_change(folder: Path, tmp_path: Path) -> None:
    train(HISTORY, folder, tmp_path, TINY, stop=lambda step: step == 6)
    before = load_network(tmp_path / "unfinished.safetensors")[0].state_dict()
    after = load_network(train(HISTORY, folder, tmp_path, TINY))[0].state_dict()
    changed = {name for name in before if not torch.equal(before[name], after[name])}
    temporal = tuple(f"blocks.{spec.name}." for spec in SPECS if getattr(TINY, spec.name).temporal)
    assert 0 < len(temporal) < len(SPECS)
    assert all(any(name.startswith(block) for name in changed) for block in temporal)
    assert all(name.startswith(temporal) for name in changed)


def test_without_a_temporal_block_there_is_no_second_stage(folder: Path, tmp_path: Path) -> None:
    blocks: dict[str, Any] = {spec.name: BlockConfig("dense", 8) for spec in SPECS}
    train(HISTORY, folder, tmp_path, replace(TINY, **blocks))
    assert len((tmp_path / "metrics.jsonl").read_text().splitlines()) == HISTORY.steps


def test_until_the_second_stage_blocks_see_no_history(folder: Path, tmp_path: Path) -> None:
    train(HISTORY, folder, tmp_path, TINY, stop=lambda step: step == 6)
    network, info = load_network(tmp_path / "unfinished.safetensors")
    held = Frames(split(find_episodes(folder), HISTORY.validation_share, HISTORY.seed)[1], (HEIGHT, WIDTH))
    assert evaluate(network, held, "fp32", context=0) == info.metrics
    assert evaluate(network, held, "fp32") != info.metrics
    network, info = load_network(train(HISTORY, folder, tmp_path, TINY))
    assert evaluate(network, held, "fp32") == info.metrics


@pytest.mark.parametrize("place", ["_features", "_history_batch"])
def test_a_run_killed_in_the_second_stage_resumes_to_the_same_network(
    place: str, whole: Path, folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(history_stage, "FRAMES_A_FILE", 50)
    original, calls = getattr(history_stage, place), list[None]()

    def killed(*arguments: Any) -> Any:
        calls.append(None)
        if len(calls) == 3:
            raise KeyboardInterrupt
        return original(*arguments)

    monkeypatch.setattr(history_stage, place, killed)
    with pytest.raises(KeyboardInterrupt):
        train(HISTORY, folder, tmp_path / "killed", TINY)
    assert list((tmp_path / "killed" / "features").iterdir())
    resumed = train(HISTORY, folder, tmp_path / "killed", TINY)
    assert resumed.read_bytes() == whole.read_bytes()
    # 160 frames in chunks of 50, of which two are kept.
    assert len(calls) == {"_features": 5, "_history_batch": 8}[place]


def test_a_finished_run_stays_as_it_is(
    whole: Path, finished: Path, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(history_stage, "_features", None)
    assert train(HISTORY, folder, finished, TINY).read_bytes() == whole.read_bytes()


def test_features_of_another_run_are_not_taken_up(whole: Path, folder: Path, tmp_path: Path) -> None:
    stale = {"features": torch.zeros(160, 256)}
    write_tensors(tmp_path / "again" / "features" / "0000.safetensors", stale, {"digest": "another"})
    assert train(HISTORY, folder, tmp_path / "again", TINY).read_bytes() == whole.read_bytes()


def test_the_digest_of_features_depends_on_all_that_makes_them(folder: Path, tmp_path: Path) -> None:
    torch.manual_seed(0)
    frames = Frames(find_episodes(folder), (HEIGHT, WIDTH))
    fewer = Frames(find_episodes(folder)[1:], (HEIGHT, WIDTH))
    first, second = Network(TINY).backbone, Network(TINY).backbone
    digest = history_stage._digest(first, "int8", (1.0,), frames)
    assert history_stage._digest(first, "int8", (1.0,), frames) == digest
    digests = [
        history_stage._digest(second, "int8", (1.0,), frames), history_stage._digest(first, "fp32", (1.0,), frames),
        history_stage._digest(first, "int8", (2.0,), frames), history_stage._digest(first, "int8", (1.0,), fewer),
    ]  # fmt: skip
    assert len({digest, *digests}) == 5


def test_a_kill_after_the_last_step_leaves_no_features(finished: Path, folder: Path) -> None:
    write_tensors(finished / "features" / "0000.safetensors", {"features": torch.zeros(1)}, {})
    train(HISTORY, folder, finished, TINY)
    assert not (finished / "features").exists()


def test_features_are_those_of_the_network_that_drives(folder: Path, tmp_path: Path) -> None:
    network, info = load_network(train(SHORT, folder, tmp_path, TINY))
    frames = Frames(find_episodes(folder), (HEIGHT, WIDTH))
    engine = backbone_engine("fp32", network.backbone, network.config.image_size, info.ranges)
    features = history_stage._features(frames, np.arange(len(frames)), engine)
    with torch.no_grad():
        expected = network.features(normalise(to_float(frames.images(np.arange(3)))))
    assert features.dtype == torch.float16
    assert torch.allclose(features[:3].float(), expected, rtol=2e-3, atol=1e-3)


def test_a_loss_that_is_no_number_ends_with_a_sentence(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("caldrive.perception.training.train.train_temporal_blocks", lambda *_: iter([1.0, math.nan]))
    sentence = "found a loss of nan at step 8, wanted a number: type a smaller --learning-rate"
    with pytest.raises(ValueError, match=sentence):
        train(HISTORY, folder, tmp_path, TINY)
