"""The blocks' own lesson: on features of a finished backbone, with history, and broken off anywhere."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from caldrive.affordances import SPECS
from caldrive.perception.dataset.frames import Frames
from caldrive.perception.evaluation.evaluate import evaluate
from caldrive.perception.images import normalise, to_float
from caldrive.perception.inference.engines import features_in
from caldrive.perception.network.checkpoint import load_network, write_tensors
from caldrive.perception.network.config import BlockConfig
from caldrive.perception.network.network import Network
from caldrive.perception.training import history_stage as blocks
from caldrive.perception.training.train import train
from caldrive.recordings.folder import find_episodes, split
from tests.perception.data import BLOCKS, HEIGHT, SHORT, TINY, WIDTH, record


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    torch.set_num_threads(1)
    return record(tmp_path_factory.mktemp("episodes"))


def test_the_blocks_learn_and_the_backbone_stays_as_it_is(folder: Path, tmp_path: Path) -> None:
    long = replace(BLOCKS, block_steps=60, learning_rate=3e-3, augment=False)
    before = load_network(train(replace(long, block_steps=0), folder, tmp_path / "before", TINY))[0]
    after, info = load_network(train(long, folder, tmp_path / "after", TINY))
    rows = [json.loads(line) for line in (tmp_path / "after" / "metrics.jsonl").read_text().splitlines()]
    assert [row["step"] for row in rows] == list(range(1, 67))
    assert np.mean([row["loss"] for row in rows[-10:]]) < 0.8 * np.mean([row["loss"] for row in rows[6:16]])
    assert rows[-1]["validation/loss"] == info.metrics["loss"]
    assert before.config == after.config
    assert not (tmp_path / "after" / "features").exists()


def test_only_blocks_that_look_back_change(folder: Path, tmp_path: Path) -> None:
    first = train(BLOCKS, folder, tmp_path, TINY, stop=lambda step: step == 6)
    before = load_network(first)[0].state_dict()
    after = load_network(train(BLOCKS, folder, tmp_path, TINY))[0].state_dict()
    changed = {name for name in before if not torch.equal(before[name], after[name])}
    back = tuple(f"blocks.{spec.name}." for spec in SPECS if getattr(TINY, spec.name).length > 1)
    assert 0 < len(back) < len(SPECS)
    assert all(any(name.startswith(one) for name in changed) for one in back)
    assert all(name.startswith(back) for name in changed)


def test_without_a_block_that_looks_back_there_is_no_such_lesson(folder: Path, tmp_path: Path) -> None:
    now: dict[str, Any] = {spec.name: BlockConfig("dense", 8) for spec in SPECS}
    train(BLOCKS, folder, tmp_path, replace(TINY, **now))
    assert len((tmp_path / "metrics.jsonl").read_text().splitlines()) == BLOCKS.steps


def test_until_the_blocks_learn_alone_they_see_no_history(folder: Path, tmp_path: Path) -> None:
    model = train(BLOCKS, folder, tmp_path, TINY, stop=lambda step: step == 6)
    network, info = load_network(model)
    held = Frames(split(find_episodes(folder), BLOCKS.validation_share, BLOCKS.seed)[1], (HEIGHT, WIDTH))
    assert evaluate(network, held, "fp32", context=0) == info.metrics
    assert evaluate(network, held, "fp32") != info.metrics
    network, info = load_network(train(BLOCKS, folder, tmp_path, TINY))
    assert evaluate(network, held, "fp32") == info.metrics


@pytest.mark.parametrize("place", ["_see", "_lesson"])
def test_a_run_killed_while_the_blocks_learn_resumes_to_the_same_network(
    place: str, folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = train(BLOCKS, folder, tmp_path / "whole", TINY)
    monkeypatch.setattr(blocks, "CHUNK", 50)
    right, calls = getattr(blocks, place), list[None]()

    def killed(*arguments: Any) -> Any:
        calls.append(None)
        if len(calls) == 3:
            raise KeyboardInterrupt
        return right(*arguments)

    monkeypatch.setattr(blocks, place, killed)
    with pytest.raises(KeyboardInterrupt):
        train(BLOCKS, folder, tmp_path / "killed", TINY)
    assert list((tmp_path / "killed" / "features").iterdir())
    resumed = train(BLOCKS, folder, tmp_path / "killed", TINY)
    assert resumed.read_bytes() == whole.read_bytes()
    assert len(calls) == {"_see": 5, "_lesson": 8}[place]  # 160 frames in chunks of 50; what was seen is kept


def test_a_finished_run_stays_as_it_is(folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    before = train(BLOCKS, folder, tmp_path, TINY).read_bytes()
    monkeypatch.setattr(blocks, "_see", None)
    assert train(BLOCKS, folder, tmp_path, TINY).read_bytes() == before


def test_features_of_another_run_are_not_taken_up(folder: Path, tmp_path: Path) -> None:
    wanted = train(BLOCKS, folder, tmp_path / "wanted", TINY)
    stale = {"features": torch.zeros(160, 256)}
    write_tensors(tmp_path / "again" / "features" / "0000.safetensors", stale, {"digest": "another"})
    assert train(BLOCKS, folder, tmp_path / "again", TINY).read_bytes() == wanted.read_bytes()


def test_the_digest_of_features_depends_on_all_that_makes_them(folder: Path, tmp_path: Path) -> None:
    torch.manual_seed(0)
    frames = Frames(find_episodes(folder), (HEIGHT, WIDTH))
    fewer = Frames(find_episodes(folder)[1:], (HEIGHT, WIDTH))
    first, second = Network(TINY).backbone, Network(TINY).backbone
    same = blocks._digest(first, "int8", (1.0,), frames)
    assert blocks._digest(first, "int8", (1.0,), frames) == same
    others = [
        blocks._digest(second, "int8", (1.0,), frames), blocks._digest(first, "fp32", (1.0,), frames),
        blocks._digest(first, "int8", (2.0,), frames), blocks._digest(first, "int8", (1.0,), fewer),
    ]  # fmt: skip
    assert len({same, *others}) == 5


def test_a_kill_after_the_last_lesson_leaves_no_features(folder: Path, tmp_path: Path) -> None:
    train(BLOCKS, folder, tmp_path, TINY)
    write_tensors(tmp_path / "features" / "0000.safetensors", {"features": torch.zeros(1)}, {})
    train(BLOCKS, folder, tmp_path, TINY)
    assert not (tmp_path / "features").exists()


def test_features_are_those_of_the_network_that_drives(folder: Path, tmp_path: Path) -> None:
    network, info = load_network(train(SHORT, folder, tmp_path, TINY))
    frames = Frames(find_episodes(folder), (HEIGHT, WIDTH))
    seen = blocks._see(frames, np.arange(len(frames)), features_in("fp32", network, info))
    with torch.no_grad():
        wanted = network.features(normalise(to_float(frames.images(np.arange(3)))))
    assert seen.dtype == torch.float16
    assert torch.allclose(seen[:3].float(), wanted, rtol=2e-3, atol=1e-3)


def test_a_lesson_whose_loss_is_no_number_ends_with_a_sentence(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("caldrive.perception.training.train.learn_blocks", lambda *_: iter([1.0, math.nan]))
    with pytest.raises(ValueError, match="found a loss of nan at step 8, wanted a number: type a smaller --rate"):
        train(BLOCKS, folder, tmp_path, TINY)
