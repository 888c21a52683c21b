from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from torch import Generator

from caldrive.datatypes import Semantic
from caldrive.perception.dataset.frames import Frames
from caldrive.perception.images import normalise, to_float
from caldrive.perception.network.network import Network
from caldrive.perception.training.config import TrainingConfig
from caldrive.perception.training.distributed import ProcessGroup
from caldrive.perception.training.loop import TrainingFrames
from caldrive.perception.training.multitask import (
    CELL,
    SEGMENTATION,
    SEGMENTED_STAGE,
    MultiTaskModel,
    SegmentationHead,
    segmentation_loss,
)
from caldrive.perception.training.run import TrainingRun
from caldrive.perception.training.train import start
from caldrive.recordings.folder import find_episodes
from tests.perception.data import HEIGHT, TINY, WIDTH, record


def test_each_cell_of_eight_pixels_has_its_own_answer() -> None:
    maps = torch.rand(2, 5, HEIGHT // 2 ** (SEGMENTED_STAGE + 1), WIDTH // 2 ** (SEGMENTED_STAGE + 1))
    assert SegmentationHead(5)(maps).shape == (2, len(Semantic), HEIGHT // CELL, WIDTH // CELL)


def test_the_true_class_costs_nothing_and_a_cell_counts_where_it_lies() -> None:
    semantics = np.random.default_rng(0).integers(0, len(Semantic), (3, 4, 6)).astype(np.uint8)
    logits = 50.0 * torch.nn.functional.one_hot(torch.from_numpy(semantics).long(), len(Semantic)).permute(0, 3, 1, 2)
    pixels = np.pad(semantics.repeat(CELL, 1).repeat(CELL, 2), ((0, 0), (0, 5), (0, 3)))  # what the pools cut off
    assert float(segmentation_loss(logits, pixels, Generator().manual_seed(0))) < 1e-6
    assert float(segmentation_loss(logits.flip(3), pixels, Generator().manual_seed(0))) > 10


def test_in_the_mean_a_cell_is_asked_for_the_shares_of_its_classes() -> None:
    pixels = np.zeros((1, CELL, CELL), np.uint8)
    pixels[:, :, 6:] = 1  # a quarter of the cell
    generator, logits = Generator().manual_seed(0), torch.zeros(1, len(Semantic), 1, 1)
    logits[:, 1] = -60.0
    drawn = [float(segmentation_loss(logits, pixels, generator)) > 30 for _ in range(400)]
    assert np.mean(drawn) == pytest.approx(0.25, abs=0.07)


def test_segmentation_is_learnt_where_there_are_semantic_images(tmp_path: Path) -> None:
    config = TrainingConfig(batch=4, warm_up=1, precision="fp32")
    plain = Frames(find_episodes(record(tmp_path / "plain")), (HEIGHT, WIDTH))
    assert start(config, TINY, TrainingFrames(plain, plain), "cpu").model.segmentation is None
    semantic = Frames(find_episodes(record(tmp_path / "semantic", semantic=True), semantic=True), (HEIGHT, WIDTH))
    learner = start(config, TINY, TrainingFrames(semantic, semantic), "cpu")
    assert learner.model.segmentation is not None
    outputs = learner.model(torch.randn(2, 3, HEIGHT, WIDTH), torch.tensor([[0], [1]]), torch.zeros(2, 1).long())
    semantics = np.zeros((2, HEIGHT, WIDTH), np.uint8)
    segmentation_loss(outputs[SEGMENTATION], semantics, Generator()).backward()
    learning = [conv.weight.grad is not None for conv in learner.network.backbone.convolutions()]
    assert learning == [True] * 10 + [False] * 3  # the last stage lies behind the head
    before = learner.model.segmentation.head.weight.clone()
    TrainingRun(learner, ProcessGroup()).advance()
    assert not torch.equal(learner.model.segmentation.head.weight, before)


@pytest.mark.parametrize("segmentation", [False, True])
def test_gradient_checkpointing_gives_the_gradient_of_all_at_once(segmentation: bool) -> None:
    torch.manual_seed(0)
    network = Network(replace(TINY, batch_norm=False))
    head = SegmentationHead(network.backbone.channels[SEGMENTED_STAGE]) if segmentation else None
    images, index, command = torch.randn(7, 3, HEIGHT, WIDTH), torch.arange(7)[:, None], torch.zeros(7, 1).long()
    gradients = []
    for chunk in (0, 3):
        model = MultiTaskModel(network, head, chunk).eval()
        model.zero_grad()
        sum(output.square().mean() for output in model(images, index, command).values()).backward()
        gradients.append([p.grad.clone() for p in model.parameters() if p.grad is not None])
    for whole, parts in zip(*gradients, strict=True):
        torch.testing.assert_close(whole, parts, rtol=1e-4, atol=1e-6)


def test_each_frame_passes_the_backbone_once(folder: Path) -> None:
    network, passed = Network(TINY).eval(), []
    frames = Frames(find_episodes(folder), (HEIGHT, WIDTH))
    network.backbone.convolutions()[0].register_forward_hook(lambda module, args, output: passed.append(len(args[0])))
    starts = frames.window_starts(4)[:8]
    batch = frames.batch(starts, 4, network.span - 1)
    outputs = MultiTaskModel(network)(normalise(to_float(batch.images)), batch.index, batch.command)
    assert outputs["hazard_stop"].shape == (32, 2)
    assert passed == [11]  # eight windows of four that begin one frame apart


def test_windows_give_what_single_frames_give(folder: Path) -> None:
    torch.manual_seed(0)
    network = Network(TINY).eval()
    frames = Frames(find_episodes(folder), (HEIGHT, WIDTH))

    def outputs(start: int, window: int) -> Any:
        batch = frames.batch(frames.window_starts(1)[[start]], window, network.span - 1)
        return MultiTaskModel(network)(normalise(to_float(batch.images)), batch.index, batch.command)

    with torch.no_grad():
        together, alone = outputs(2, 5), outputs(5, 1)
    for name in together:
        torch.testing.assert_close(together[name][3:4], alone[name], rtol=1e-4, atol=1e-5)
