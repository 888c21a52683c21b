"""The figures of a network on recorded frames, by groups, with the frames that it gets most wrong."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import torch

from caldrive.perception.dataset import Frames, find_episodes, held_out, split, summary
from caldrive.perception.network import Network
from caldrive.perception.report import APART, PAPER, errors, report, worst
from caldrive.perception.specs import SPECS
from tests.perception_data import HEIGHT, TINY, WIDTH, record


@pytest.fixture(scope="module")
def frames(tmp_path_factory: pytest.TempPathFactory) -> Frames:
    torch.set_num_threads(1)
    return Frames(find_episodes(record(tmp_path_factory.mktemp("recording"))), (HEIGHT, WIDTH))


def test_every_frame_counts_once_in_the_confusions_and_in_each_kind_of_group(frames: Frames, tmp_path: Path) -> None:
    found = report(Network(TINY), frames, tmp_path / "worst.png")
    assert found.frames == len(frames)
    assert all(sum(map(sum, table)) == found.frames for table in found.confusion.values())
    assert set(found.groups) == {"command", "weather", "town"}
    assert set(found.groups["town"]) == {"town01"}
    assert found.groups["weather"]["1"] == pytest.approx(found.overall)
    assert set(PAPER) <= set(found.overall)
    assert (tmp_path / "worst.png").read_bytes().startswith(b"\x89PNG")


def test_errors_are_in_si_units_or_the_belief_that_truth_did_not_get() -> None:
    by_name = {spec.name: spec for spec in SPECS}
    far = errors(
        by_name["vehicle_distance"],
        {"vehicle_distance": torch.tensor([[0.5]])},
        {"vehicle_distance": torch.tensor([0.2])},
    )
    assert far == pytest.approx([15.0])
    sure = {"red_light": torch.tensor([[0.0, 20.0], [0.0, 0.0]])}
    assert errors(by_name["red_light"], sure, {"red_light": torch.tensor([0, 1])}) == pytest.approx([1.0, 0.5])


def test_the_worst_frames_are_not_neighbours() -> None:
    ids = np.arange(200)
    wrong = np.exp(-((ids - 100) ** 2) / 50.0)
    chosen = worst(wrong, ids)
    assert chosen[0] == 100
    assert min(abs(a - b) for i, a in enumerate(chosen) for b in chosen[:i]) > APART


def test_held_out_episodes_are_those_of_the_training(frames: Frames, tmp_path: Path) -> None:
    episodes = find_episodes(record(tmp_path))
    learnt, kept = split(episodes, 0.05, seed=0)
    size = HEIGHT, WIDTH
    data = summary(Frames(learnt, size), Frames(kept, size))
    assert held_out(episodes, data) == kept
    for known in ({}, data | {"validation_episodes": ["another/town01/1/7"]}):
        with pytest.raises(ValueError, match="leave --held-out away"):
            held_out(episodes, known)
