from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch
from torch import Generator, Tensor

from caldrive.perception.dataset.augmentation import augment
from caldrive.perception.dataset.config import AugmentationConfig
from caldrive.perception.images import DEVIATION, MEAN, normalise, to_float

OFF = AugmentationConfig(color=0, saturation=0, contrast=0, brightness=0, blur=0, noise=0, share=1, rare_share=1)


def batch(n: int = 6) -> Tensor:
    return to_float(np.random.default_rng(0).integers(40, 200, (n, 16, 24, 3), dtype=np.uint8))


def augmented(config: AugmentationConfig | None = None, seed: int = 0, groups: Tensor | None = None) -> Tensor:
    return augment(batch(), Generator().manual_seed(seed), groups, config)


def test_normalisation_is_imagenets() -> None:
    images = normalise(batch())
    expected = (batch() - torch.tensor(MEAN).view(3, 1, 1)) / torch.tensor(DEVIATION).view(3, 1, 1)
    torch.testing.assert_close(images, expected)
    assert images.is_contiguous(memory_format=torch.channels_last)


def test_one_seed_gives_one_result() -> None:
    assert torch.equal(augmented(seed=4), augmented(seed=4))
    assert not torch.equal(augmented(seed=4), augmented(seed=5))


def test_pixels_stay_between_black_and_white() -> None:
    images = augmented(AugmentationConfig(share=1, rare_share=1, brightness=0.8, contrast=0.9))
    assert images.min() >= 0
    assert images.max() <= 1


def test_nothing_changes_at_strength_zero() -> None:
    torch.testing.assert_close(augmented(OFF), batch())


@pytest.mark.parametrize("name", ["color", "contrast", "brightness"])
def test_light_changes_a_frame_by_one_gain_and_shift_for_each_channel(name: str) -> None:
    images = augmented(AugmentationConfig(**(vars(OFF) | {name: 0.1})))
    x, y = batch()[0, 1].flatten(), images[0, 1].flatten()
    assert not torch.equal(x, y)
    assert torch.corrcoef(torch.stack((x, y)))[0, 1] > 0.9999


def test_saturation_moves_colours_to_and_from_grey_and_keeps_it() -> None:
    images = augmented(replace(OFF, saturation=0.5))
    before, after = (x - x.mean(dim=1, keepdim=True) for x in (batch(), images))
    strength = (after.flatten(1).norm(dim=1) / before.flatten(1).norm(dim=1)).tolist()
    assert min(strength) < 0.9
    assert max(strength) > 1.1
    torch.testing.assert_close(images.mean(dim=1), batch().mean(dim=1), atol=0.06, rtol=0)


def test_blur_smooths_and_keeps_the_mean() -> None:
    images = augmented(replace(OFF, blur=3.0))
    assert images.std() < 0.8 * batch().std()
    assert float(images.mean()) == pytest.approx(float(batch().mean()), abs=0.01)


def test_blur_keeps_colours_apart() -> None:
    red = torch.zeros(1, 16, 24, 3, dtype=torch.uint8)
    red[..., 0] = 200
    images = augment(to_float(red.numpy()), Generator().manual_seed(1), None, replace(OFF, blur=3.0))
    torch.testing.assert_close(images, to_float(red.numpy()))


def test_salt_and_pepper_is_white_and_black_and_rare() -> None:
    images = augmented(replace(OFF, noise=0.1))
    changed = (images != batch()).any(dim=1)
    assert 0 < changed.float().mean() < 0.1
    assert set(images.permute(0, 2, 3, 1)[changed].unique().tolist()) == {0.0, 1.0}


def test_frames_of_one_window_change_alike() -> None:
    same = torch.zeros(6, 3, 8, 8).contiguous(memory_format=torch.channels_last) + 0.5
    config = replace(OFF, color=0.2, brightness=0.2)
    images = augment(same, Generator().manual_seed(0), torch.tensor([0, 0, 0, 2, 2, 2]), config)[:, :, 0, 0]
    assert torch.equal(images[0], images[2])
    assert torch.equal(images[3], images[5])
    assert not torch.equal(images[0], images[3])
