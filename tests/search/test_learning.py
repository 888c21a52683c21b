"""Blocks learn from stored features, and their scores are those of the supplement."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from caldrive.affordances import BY_NAME
from caldrive.perception.network.config import BlockConfig
from caldrive.perception.network.network import TaskBlock
from caldrive.search.examples import Source, load_examples
from caldrive.search.learning import class_counts, learn, measured_training, one_thread, score, training_config
from tests.search.data import TINY_SEARCH

CENTER = "center_distance"


def test_a_block_learns_from_features(source: Source) -> None:
    training, _ = load_examples(source)
    torch.manual_seed(0)
    block = TaskBlock(BlockConfig("dense", 32, 0.0, norm="layer"), BY_NAME[CENTER], training.features.shape[1])
    losses = list(learn({CENTER: block}, training, training_config(TINY_SEARCH, 0, steps=150)))
    assert np.mean(losses[-20:]) < 0.8 * np.mean(losses[:20])


def test_a_training_is_measured_as_often_as_asked_and_at_its_end(source: Source) -> None:
    examples = load_examples(source)
    ids = examples[1].targets
    found = list(measured_training(CENTER, BlockConfig("gru", 4, length=3), examples, ids, TINY_SEARCH, 3))
    assert [step for step, _ in found] == [1, 2, 3, 4, 5]
    assert found == list(measured_training(CENTER, BlockConfig("gru", 4, length=3), examples, ids, TINY_SEARCH, 3))


def test_errors_are_scaled_and_clipped() -> None:
    outputs, target = torch.tensor([[0.5], [-9.0]]), torch.tensor([0.25, 0.0])
    assert score(CENTER, outputs, target) == pytest.approx((0.25 + BY_NAME[CENTER].high / BY_NAME[CENTER].scale) / 2)


def test_rare_classes_are_expected_as_rarely_as_they_are() -> None:
    undecided, target = torch.tensor([[0.0, 0.1], [0.0, 5.0], [0.0, 0.2]]), torch.tensor([0, 1, 0])
    assert score("red_light", undecided, target) == pytest.approx((0 + 1 / 3) / 2)
    assert score("red_light", undecided, target, counts=(90, 10)) == 1.0


def test_frames_of_one_class_show_nothing() -> None:
    assert score("red_light", torch.tensor([[1.0, 0.0]]), torch.tensor([0])) is None


def test_classes_are_counted_where_there_are_some(source: Source) -> None:
    training, _ = load_examples(source)
    counts = class_counts("hazard_stop", training, training.targets)
    assert sum(counts) == len(training.targets)
    assert 0 < counts[1] < counts[0]
    assert class_counts(CENTER, training, training.targets) == []


def test_one_thread_is_given_back() -> None:
    before = torch.get_num_threads()
    with one_thread():
        assert torch.get_num_threads() == 1
    assert torch.get_num_threads() == before
