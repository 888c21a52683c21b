from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from torch import Generator, Tensor

from caldrive.datatypes import Semantic
from caldrive.perception.dataset.config import RecolourConfig
from caldrive.perception.dataset.recolour import COVERED, FREEDOM, RULES, SHADED, recolour
from caldrive.perception.images import to_float
from caldrive.perception.training.config import LossWeights, TrainingConfig
from caldrive.perception.training.train import train
from tests.perception.data import TINY, record

ALL = RecolourConfig(share=1.0, grain=0.0, patches=0, shadows=0)
PATCHES = RecolourConfig(share=1.0, tint=0.0, light=0.0, plain=0.0, grain=0.0, patches=12, shadows=0)
SHADOWS = replace(PATCHES, patches=0, shadows=3)


def scene(n: int = 4) -> tuple[Tensor, np.ndarray]:
    """Pictures whose rows of pixels are of one class each."""
    rng = np.random.default_rng(0)
    semantics = np.tile(np.arange(len(Semantic), dtype=np.uint8)[None, :, None], (n, 1, 9))
    return to_float(rng.integers(60, 180, (n, len(Semantic), 9, 3), dtype=np.uint8)), semantics


def recoloured(config: RecolourConfig, groups: list[int], seed: int = 0) -> Tensor:
    images, semantics = scene(len(groups))
    return recolour(images, semantics, torch.tensor(groups), Generator().manual_seed(seed), config)


def test_every_class_has_its_rule_where_its_number_finds_it() -> None:
    assert set(RULES) == set(Semantic)
    for kind, rule in RULES.items():
        assert (COVERED[kind], SHADED[kind]) == (rule.covered, rule.shaded)
        assert float(FREEDOM[kind]) == pytest.approx(rule.freedom)


def test_shadows_fall_on_ground_and_walls_and_on_nothing_that_moves_or_tells() -> None:
    images, semantics = scene(40)
    after = recolour(images.clone(), semantics, torch.arange(40), Generator().manual_seed(0), SHADOWS)
    changed = ((after - images).abs() > 0.02).float().mean(dim=(0, 1, 3))
    spared = [Semantic.SKY, Semantic.LIGHT, Semantic.SIGN, Semantic.VEHICLE, Semantic.PERSON]
    assert float(changed[[k for k in Semantic if k not in spared]].min()) > 0.2
    assert float(changed[spared].max()) == 0


def test_patches_cover_what_stands_beside_the_road_and_nothing_on_it() -> None:
    images = recoloured(PATCHES, list(range(40)))
    change = (images - scene(40)[0]).abs().mean(dim=(0, 1, 3))  # by row, which is the class
    on_it = [Semantic.ROAD, Semantic.LINE, Semantic.LIGHT, Semantic.SIGN, Semantic.VEHICLE, Semantic.PERSON]
    assert float(change[on_it].max()) < 1e-6
    assert change[Semantic.BUILDING] > 0.02
    assert change[Semantic.SIDEWALK] > 0.02


def test_lights_and_signs_keep_their_colours_and_houses_do_not() -> None:
    change = (recoloured(ALL, [0, 1, 2, 3]) - scene()[0]).abs().mean(dim=(0, 1, 3))  # by row, which is the class
    assert change[Semantic.LIGHT] == 0
    assert change[Semantic.SIGN] == 0
    assert change[Semantic.BUILDING] > 0.03
    assert change[Semantic.SIDEWALK] > 0.03
    assert 0 < change[Semantic.LINE] < 0.5 * change[Semantic.BUILDING]


def test_a_class_changes_by_one_rule_throughout_a_picture() -> None:
    plain = RecolourConfig(share=1.0, grain=0.0, plain=0.0, patches=0, shadows=0)
    after, before = recoloured(plain, [0]), scene(1)[0]
    factors = (after / before)[0, :, Semantic.ROAD]  # (3, W)
    assert float(factors.std(dim=1).max()) < 1e-3


def test_frames_of_one_window_get_the_same_colours() -> None:
    images, semantics = scene(1)
    same = images.repeat(4, 1, 1, 1).contiguous(memory_format=torch.channels_last)
    groups = torch.tensor([0, 0, 2, 2])
    after = recolour(same, semantics.repeat(4, 0), groups, Generator().manual_seed(1), ALL)
    assert torch.equal(after[0], after[1])
    assert torch.equal(after[2], after[3])
    assert not torch.equal(after[0], after[2])


def test_a_share_of_the_pictures_stays_as_it_is() -> None:
    images, _ = scene(200)
    after = recoloured(RecolourConfig(share=0.3), list(range(200)))
    unchanged = (after == images).flatten(1).all(dim=1).float().mean()
    assert float(unchanged) == pytest.approx(0.7, abs=0.12)
    assert float(after.min()) >= 0
    assert float(after.max()) <= 1


def test_training_recolours_where_the_recording_has_semantic_images(tmp_path: Path) -> None:
    for semantic in (False, True):
        record(tmp_path / str(semantic), semantic=semantic)
    config = TrainingConfig(
        steps=2, batch=4, warm_up=1, history_steps=0, loss_weights=LossWeights(segmentation=0.0), evaluate_every=9,
        precision="fp32", validation_share=0.3,
    )  # fmt: skip
    first, second = (train(config, tmp_path / name, tmp_path / f"out{name}", TINY) for name in ("False", "True"))
    assert first.read_bytes() != second.read_bytes()
