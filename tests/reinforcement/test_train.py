"""A training by reinforcement: killed and resumed as if unbroken, whole on disk, and driven by what it leaves."""

from __future__ import annotations

import importlib
import json
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from safetensors.torch import load_file

from caldrive.agents.modular_pipeline.checkpoint import SegmentationInfo, save_segmentation
from caldrive.agents.modular_pipeline.config import SegmentationConfig
from caldrive.agents.modular_pipeline.segmentation import SegmentationNetwork
from caldrive.agents.reinforcement.checkpoint import load_policy
from caldrive.agents.reinforcement.encoder import Encoder
from caldrive.files import locked_folder
from caldrive.perception.network.tensor_file import UNFINISHED, CheckpointError, read_header, write_tensors
from caldrive.reinforcement.config import REINFORCEMENTS, ReinforcementConfig
from caldrive.reinforcement.train import draw_curves, train_rl
from tests.reinforcement.data import SHORT, straight_road

__all__ = ["straight_road"]
pytestmark = pytest.mark.usefixtures("straight_road")


def same(one: Path, other: Path) -> bool:
    first, second = load_file(one), load_file(other)
    return first.keys() == second.keys() and all(torch.equal(first[name], second[name]) for name in first)


def rows(folder: Path) -> list[dict[str, float]]:
    found = [json.loads(line) for line in (folder / "metrics.jsonl").read_text().splitlines()]
    return [{name: value for name, value in row.items() if name != "steps_per_s"} for row in found]


def test_a_training_leaves_a_policy_its_state_its_metrics_and_curves(tmp_path: Path) -> None:
    model = train_rl(SHORT, tmp_path)
    policy, info, _ = load_policy(model)
    assert (info.steps, info.seed, info.policy) == (128, 0, policy.config)
    assert info.training["reward"] == "roach"
    assert [row["step"] for row in rows(tmp_path)] == [32, 64, 96, 128]
    assert (tmp_path / "curves.png").read_bytes().startswith(b"\x89PNG")
    assert not (tmp_path / UNFINISHED).exists()
    assert sorted(path.name for path in (tmp_path / "checkpoints").iterdir()) == ["050.safetensors", "100.safetensors"]
    assert same(tmp_path / "checkpoints" / "100.safetensors", model)


@pytest.mark.parametrize("stopped_after", [2, 3])
def test_a_run_that_is_killed_and_resumed_is_the_same_as_an_unbroken_one(tmp_path: Path, stopped_after: int) -> None:
    unbroken = train_rl(SHORT, tmp_path / "unbroken")
    train_rl(SHORT, tmp_path / "broken", stop=lambda update: update == stopped_after)
    assert not (tmp_path / "broken" / "model.safetensors").exists()
    broken = train_rl(SHORT, tmp_path / "broken")
    assert same(broken, unbroken)
    assert same(broken.with_name("state.safetensors"), unbroken.with_name("state.safetensors"))
    assert read_header(broken.with_name("state.safetensors")) == read_header(unbroken.with_name("state.safetensors"))
    assert rows(tmp_path / "broken") == rows(tmp_path / "unbroken")


def test_the_seed_decides_the_weights(tmp_path: Path) -> None:
    first = train_rl(replace(SHORT, steps=32), tmp_path / "first")
    again = train_rl(replace(SHORT, steps=32), tmp_path / "again")
    other = train_rl(replace(SHORT, steps=32, seed=1), tmp_path / "other")
    assert same(first, again)
    assert not same(first, other)


def test_a_finished_training_is_not_done_again_but_its_policy_comes_back(tmp_path: Path) -> None:
    model = train_rl(SHORT, tmp_path)
    before = model.read_bytes()
    model.unlink()
    assert train_rl(SHORT, tmp_path).read_bytes() == before


def test_a_state_of_other_settings_or_none_at_all_is_refused(tmp_path: Path) -> None:
    train_rl(SHORT, tmp_path, stop=lambda update: update == 2)
    with pytest.raises(CheckpointError, match=r"with entropy 0\.01, wanted 0\.5: type the same settings"):
        train_rl(replace(SHORT, entropy=0.5), tmp_path)
    state = tmp_path / "state.safetensors"
    write_tensors(state, {}, read_header(state))
    with pytest.raises(CheckpointError, match="is damaged"):
        train_rl(SHORT, tmp_path)
    write_tensors(state, {}, {"kind": "network"})
    with pytest.raises(CheckpointError, match=r"found in .* a network, wanted a reinforcement training"):
        train_rl(SHORT, tmp_path)
    with locked_folder(tmp_path), pytest.raises(ValueError, match="found another process at work"):
        train_rl(SHORT, tmp_path)


@pytest.mark.parametrize("preset", ["paper", "affordances"])
def test_a_preset_learns(tmp_path: Path, preset: str) -> None:
    config = replace(
        REINFORCEMENTS[preset], steps=32, environments=2, processes=False, rollout=16, batch=16, hidden=16, device="cpu"
    )
    said: list[tuple[str, float]] = []
    before, after = (load_policy(train_rl(replace(config, learning_rate=rate), tmp_path / str(rate),
                                          lambda label, share: said.append((label, share))))[0]
                     for rate in (1e-9, 1e-2))  # fmt: skip
    assert any((a != b).any() for a, b in zip(before.parameters(), after.parameters(), strict=True))
    assert said[-1][1] == 1.0
    assert "32 decisions" in said[-1][0]


def test_a_policy_learns_on_the_features_of_a_frozen_encoder(tmp_path: Path) -> None:
    torch.manual_seed(0)
    segmentation = SegmentationConfig(image_width=64, image_height=64, width=0.05)
    network, path = SegmentationNetwork(segmentation), tmp_path / "mp.safetensors"
    save_segmentation(path, network, SegmentationInfo(segmentation))
    config = replace(SHORT, steps=32, sees="features", encoder=path)
    _, info, encoder = load_policy(train_rl(config, tmp_path / "out"))
    assert info.policy.n_features == Encoder(network.backbone, (64, 64)).n_features
    assert info.training["encoder"] == "mp.safetensors"
    assert encoder is not None
    pairs = zip(encoder.backbone.parameters(), network.backbone.parameters(), strict=True)
    assert all((after.half() == before.half()).all() for after, before in pairs)


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ({"batch": 100}, "wanted a multiple of the batch"),
        ({"towns": ("town02",)}, "found town02 to learn from"),
        ({"towns": ("random:9000001",)}, "as towns from there on only judge"),
        ({"encoder": Path("mp.safetensors")}, "but a policy that sees affordances has none: leave it out"),
        ({"steps": 0}, "found --steps 0"),
    ],
)
def test_settings_that_cannot_be_are_said_in_one_sentence(settings: dict[str, Any], said: str) -> None:
    with pytest.raises(ValueError, match=said):
        replace(ReinforcementConfig(), **settings)


@pytest.mark.parametrize(("settings", "said"), [({"reward": "roch"}, "roach"), ({"tasks": ("swim",)}, "straight")])
def test_a_reward_or_a_task_that_there_is_not_is_said_before_anything_is_made(
    tmp_path: Path, settings: dict[str, Any], said: str
) -> None:
    with pytest.raises(ValueError, match=f"did you mean {said}"):
        train_rl(replace(SHORT, **settings), tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_without_stable_baselines_it_is_said_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "stable_baselines3", None)
    monkeypatch.delitem(sys.modules, "caldrive.reinforcement.run")
    with pytest.raises(ModuleNotFoundError, match=r"type pip install 'caldrive\[rl\]'"):
        importlib.import_module("caldrive.reinforcement.run")


def test_curves_are_drawn_of_whatever_there_is(tmp_path: Path) -> None:
    row = dict.fromkeys(("reward_per_step", "level", "entropy", "kl", "explained_variance", "loss"), 0.5)
    draw_curves([row | {"step": 64 * k} for k in range(3)], tmp_path / "curves.png")
    assert np.frombuffer((tmp_path / "curves.png").read_bytes()[:4], np.uint8)[0] == 0x89
