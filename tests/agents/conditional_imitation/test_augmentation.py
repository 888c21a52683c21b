"""The published augmentation: how often each change comes, and how strong it is."""

from __future__ import annotations

import pytest
import torch
from torch import Generator, Tensor

from caldrive.agents.conditional_imitation.augmentation import CHANGES, augment_as_published


def changed(name: str, images: Tensor, seed: int = 0) -> Tensor:
    return CHANGES[name].apply(images, Generator().manual_seed(seed))


def grey(n: int = 200, value: float = 0.5) -> Tensor:
    return torch.full((n, 3, 22, 50), value)


def test_images_stay_images_and_the_same_seed_gives_the_same() -> None:
    images = torch.rand(32, 3, 22, 50)
    one, two = (augment_as_published(images, Generator().manual_seed(4)) for _ in range(2))
    assert torch.equal(one, two)
    assert one.shape == images.shape
    assert (one.min(), one.max()) == (0, 1)


def test_as_many_images_are_left_alone_as_the_chances_say() -> None:
    images = torch.rand(600, 3, 8, 8) * 0.2 + 0.4
    same = (augment_as_published(images, Generator().manual_seed(0)) == images).flatten(1).all(dim=1)
    alone = 1.0
    for change in CHANGES.values():
        alone *= 1 - change.probability
    assert float(same.float().mean()) == pytest.approx(alone, abs=0.05)  # one in six


def test_brightness_is_added_and_multiplied_within_its_limits() -> None:
    added = changed("other brightness", grey()) - 0.5
    assert float(added.abs().max()) <= 40 / 255 + 1e-6
    assert float(added.abs().max()) > 0.9 * 40 / 255
    factor = changed("multiplied brightness", grey()) / 0.5
    assert 0.1 <= float(factor.min()) < 0.2
    assert 2.3 < float(factor.max()) <= 2.5
    by_channel = (factor[:, 0] != factor[:, 1]).flatten(1).any(dim=1)
    assert float(by_channel.float().mean()) == pytest.approx(0.2, abs=0.08)


def test_contrast_turns_around_grey() -> None:
    assert torch.allclose(changed("other contrast", grey()), grey())
    bright = changed("other contrast", grey(value=0.7)) - 0.5
    assert 0.1 - 1e-6 <= float(bright.min()) < float(bright.max()) <= 0.3 + 1e-6


@pytest.mark.parametrize("name", ["dropout of pixels", "dropout of patches"])
def test_up_to_a_tenth_of_an_image_is_dropped(name: str) -> None:
    dropped = (changed(name, grey()) == 0).float().mean(dim=(1, 2, 3))
    assert 0.03 < float(dropped.mean()) < 0.07
    assert float(dropped.max()) < 0.35


def test_a_blur_keeps_the_mean_and_takes_the_edges() -> None:
    images = torch.zeros(50, 3, 22, 50)
    images[:, :, :, 25:] = 1.0
    blurred = changed("Gaussian blur", images)
    assert torch.allclose(blurred.mean(dim=(1, 2, 3)), images.mean(dim=(1, 2, 3)), atol=0.01)
    steepest = blurred.diff(dim=3).amax(dim=(1, 2, 3))
    assert float(steepest.min()) == pytest.approx(0.26, abs=0.03)  # of a deviation of 1.5 pixels: 0.4 / 1.5
    assert float(steepest.max()) > 0.9


def test_noise_is_no_stronger_than_it_may_be() -> None:
    deviation = (changed("Gaussian noise", grey()) - 0.5).std(dim=(1, 2, 3))
    assert float(deviation.max()) == pytest.approx(0.05 / 255, rel=0.1)
    assert float(deviation.mean()) == pytest.approx(0.025 / 255, rel=0.16)
