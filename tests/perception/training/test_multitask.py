from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import torch
from torch import Generator

from caldrive.perception.dataset.frames import Frames
from caldrive.perception.dataset.recolour import FREEDOM
from caldrive.perception.training.config import TrainingConfig
from caldrive.perception.training.distributed import Team
from caldrive.perception.training.multitask import CELL, STAGE, Segmentation, segmentation_loss
from caldrive.perception.training.run import start
from caldrive.recordings.folder import find_episodes
from tests.perception.data import HEIGHT, TINY, WIDTH, record


def test_each_cell_of_eight_pixels_has_its_own_answer() -> None:
    maps = torch.rand(2, 5, HEIGHT // 2 ** (STAGE + 1), WIDTH // 2 ** (STAGE + 1))
    assert Segmentation(5)(maps).shape == (2, len(FREEDOM), HEIGHT // CELL, WIDTH // CELL)


def test_the_right_answer_costs_nothing_and_a_cell_counts_where_it_lies() -> None:
    semantics = np.random.default_rng(0).integers(0, len(FREEDOM), (3, 4, 6)).astype(np.uint8)
    right = 50.0 * torch.nn.functional.one_hot(torch.from_numpy(semantics).long(), len(FREEDOM)).permute(0, 3, 1, 2)
    pixels = np.pad(semantics.repeat(CELL, 1).repeat(CELL, 2), ((0, 0), (0, 5), (0, 3)))  # what the pools cut off
    assert float(segmentation_loss(right, pixels, Generator().manual_seed(0))) < 1e-6
    assert float(segmentation_loss(right.flip(3), pixels, Generator().manual_seed(0))) > 10


def test_in_the_mean_a_cell_is_asked_for_the_shares_of_its_classes() -> None:
    pixels = np.zeros((1, CELL, CELL), np.uint8)
    pixels[:, :, 6:] = 1  # a quarter of the cell
    generator, logits = Generator().manual_seed(0), torch.zeros(1, len(FREEDOM), 1, 1)
    logits[:, 1] = -60.0
    drawn = [float(segmentation_loss(logits, pixels, generator)) > 30 for _ in range(400)]
    assert np.mean(drawn) == pytest.approx(0.25, abs=0.07)


def test_the_lesson_is_given_where_there_are_semantic_images(tmp_path: Path) -> None:
    config = TrainingConfig(batch=4, warm_up=1, precision="fp32")
    plain = Frames(find_episodes(record(tmp_path / "plain")), (HEIGHT, WIDTH))
    assert start(config, TINY, plain, None, Team()).lessons.segmentation is None
    painted = Frames(find_episodes(record(tmp_path / "painted", semantic=True), semantic=True), (HEIGHT, WIDTH))
    run = start(config, TINY, painted, None, Team())
    assert run.lessons.segmentation is not None
    outputs = run.lessons(torch.randn(2, 3, HEIGHT, WIDTH), torch.tensor([[0], [1]]), torch.zeros(2, 1).long())
    semantics = np.zeros((2, HEIGHT, WIDTH), np.uint8)
    segmentation_loss(outputs["segmentation"], semantics, Generator()).backward()
    learning = [conv.weight.grad is not None for conv in run.network.backbone.convolutions()]
    assert learning == [True] * 10 + [False] * 3  # the last stage lies behind the head
    before = run.lessons.segmentation.head.weight.clone()
    run.advance()
    assert not torch.equal(run.lessons.segmentation.head.weight, before)
