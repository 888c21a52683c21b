"""What a search learns from: whole held-out episodes, the same frames for all blocks, and no town that judges."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from caldrive.affordances import BY_NAME
from caldrive.datatypes import Pose
from caldrive.perception.network.checkpoint import load_network
from caldrive.perception.network.config import BlockConfig
from caldrive.perception.network.network import TaskBlock
from caldrive.perception.network.tensor_file import CheckpointError, read_tensors, write_tensors
from caldrive.progress import silent
from caldrive.recordings.writer import EpisodeError
from caldrive.scenarios import Scenario
from caldrive.search import examples as examples_module
from caldrive.search.config import SearchConfig
from caldrive.search.examples import (
    HISTORY,
    Examples,
    Source,
    checked_parts,
    evenly,
    load_examples,
    make_features,
    split_episodes,
)
from caldrive.search.learning import outputs_of
from tests.perception.data import record
from tests.search.data import TINY_SEARCH


@pytest.fixture(scope="module")
def parts(source: Source) -> tuple[Examples, Examples]:
    return load_examples(source)


def test_the_networks_own_held_out_episodes_validate(source: Source, parts: tuple[Examples, Examples]) -> None:
    keys = [{episode.key for episode in part.frames.episodes} for part in parts]
    assert sorted(keys[1]) == load_network(source.model)[1].data["validation_episodes"]
    assert not keys[0] & keys[1]
    assert len(keys[0] | keys[1]) == 4


def test_an_episodes_first_frames_are_history_only(parts: tuple[Examples, Examples]) -> None:
    for part in parts:
        steps = part.frames.time_step[part.targets]
        assert steps.min() == HISTORY
        assert len(steps) == 30 * 2 * len(part.frames.episodes)  # of 90 frames, by two cameras


@pytest.mark.parametrize("layer", ["gru", "tconv"])
def test_a_block_sees_in_a_search_what_it_sees_when_it_drives(parts: tuple[Examples, Examples], layer: str) -> None:
    torch.manual_seed(0)
    config = BlockConfig(layer, 6, 0.0, length=5, dilation=3)  # type: ignore[arg-type]
    examples, ids = parts[0], np.array([2, 70, 91, 170])  # two of them before the history is whole
    block = TaskBlock(config, BY_NAME["hazard_stop"], examples.features.shape[1])
    found = outputs_of(block, examples, ids)
    for row, i in enumerate(ids):
        history = examples.features[examples.frames.stream_start[i] : i + 1].float()[None]
        expected = block(history, torch.zeros(1, 1, dtype=torch.long))[0]
        torch.testing.assert_close(found[row], expected.detach())


def test_frames_are_taken_as_far_apart_as_can_be() -> None:
    assert evenly(np.arange(10), 4).tolist() == [0, 3, 6, 9]
    assert evenly(np.arange(3), 4).tolist() == [0, 1, 2]
    assert evenly(np.arange(0), 4).tolist() == []


def test_features_are_made_once(source: Source, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(examples_module, "feature_table", None)
    make_features(source, checked_parts(source, TINY_SEARCH), silent)


def test_features_of_another_network_are_not_taken(source: Source, tmp_path: Path) -> None:
    other = replace(source, out=tmp_path)
    for part in ("training", "validation"):
        stale = {"features": torch.zeros(1, 1)}
        write_tensors(tmp_path / "features" / f"{part}.safetensors", stale, {"kind": "features", "digest": "another"})
    make_features(other, checked_parts(other, TINY_SEARCH), silent)
    assert torch.equal(load_examples(other)[1].features, load_examples(source)[1].features)


def test_a_network_of_other_affordances_is_refused(source: Source, tmp_path: Path) -> None:
    tensors, header = read_tensors(source.model)
    write_tensors(tmp_path / "model.safetensors", tensors, header | {"specs": []})
    with pytest.raises(CheckpointError, match="a network for other affordances"):
        checked_parts(replace(source, model=tmp_path / "model.safetensors"), TINY_SEARCH)


def test_a_recording_without_the_held_out_episodes_is_refused(source: Source, tmp_path: Path) -> None:
    scenario = Scenario("town01", weather=3, start=Pose(0, 0, 0), goal=Pose(1, 2, 3), seed=8)
    other = replace(source, data=record(tmp_path, n_frames=62, n_cameras=1, scenario=scenario))
    with pytest.raises(EpisodeError, match=r"that the training of .* held out, .* type --validation-share 0\.1"):
        split_episodes(other, images=False)
    training, validation = split_episodes(replace(other, validation_share=0.3), images=False)
    assert (len(training), len(validation)) == (2, 1)


@pytest.mark.parametrize("town", ["town02", "random:9000001"])
def test_towns_that_judge_are_refused(town: str, source: Source, tmp_path: Path) -> None:
    scenario = Scenario(town, weather=1, start=Pose(0, 0, 0), goal=Pose(1, 2, 3), seed=7)
    other = replace(source, data=record(tmp_path, n_frames=2, n_cameras=1, scenario=scenario), validation_share=0.5)
    with pytest.raises(ValueError, match=f"found (episodes of )?{town}"):
        split_episodes(other, images=False)


def test_episodes_that_are_too_short_are_refused(source: Source, tmp_path: Path) -> None:
    other = replace(source, data=record(tmp_path, n_frames=60, n_cameras=1), validation_share=0.3)
    with pytest.raises(EpisodeError, match=r"found no frame of training in .* behind the first 60 of its episode"):
        checked_parts(other, TINY_SEARCH)


def test_an_affordance_that_never_changes_is_refused(source: Source) -> None:
    with pytest.raises(EpisodeError, match=r"found one value only of the red light .* or leave it out of --tasks"):
        checked_parts(source, SearchConfig(tasks=("red_light",)))
