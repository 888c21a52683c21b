from __future__ import annotations

import numpy as np
import pytest

from caldrive.datatypes import Image
from caldrive.perception.camera_faults import DYING, FAULTS, FROZEN, TORN, make_fault
from caldrive.perception.network.camera_check import REASONS


def picture(seed: int = 0) -> Image:
    """A sky, a road and things of many colours."""
    rng = np.random.default_rng(seed)
    image = np.kron(rng.integers(20, 220, (11, 25, 3)), np.ones((8, 8, 1))).astype(np.uint8)
    image[:40] = (120, 160, 230)
    return image


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_gives_a_picture_of_the_same_kind_and_leaves_the_true_one_alone(name: str) -> None:
    true, fault = picture(), make_fault(name, 3)
    shown = [fault(true, 20.0), fault(picture(1), 20.1)]
    for image in shown:
        assert image.shape == true.shape
        assert image.dtype == np.uint8
        assert image.flags["C_CONTIGUOUS"]
    assert not np.array_equal(shown[1], picture(1))
    assert np.array_equal(true, picture())


@pytest.mark.parametrize("name", FAULTS)
def test_the_same_seed_fails_in_the_same_way(name: str) -> None:
    first, second = ([f(picture(k), 10.0 + k) for k in range(3)] for f in (make_fault(name, 5), make_fault(name, 5)))
    assert np.array_equal(first, second)


def test_a_slow_fault_begins_with_the_true_picture_and_ends_without_one() -> None:
    for name in ("dying", "fading"):
        assert np.array_equal(make_fault(name)(picture(), 0.0), picture())
        assert make_fault(name)(picture(), DYING).std() == 0


def test_a_frozen_camera_shows_its_first_picture_and_a_torn_one_half_of_it() -> None:
    frozen, torn = make_fault(FROZEN), make_fault(TORN)
    for fault in (frozen, torn):
        fault(picture(0), 0.0)
    assert np.array_equal(frozen(picture(1), 1.0), picture(0))
    assert np.array_equal(torn(picture(1), 1.0)[44:], picture(0)[44:])
    assert np.array_equal(torn(picture(1), 1.0)[:44], picture(1)[:44])


def test_dirt_stays_where_it_is() -> None:
    fault = make_fault("dirt on the lens", 1)
    changed = [np.any(fault(picture(k), k / 10.0) != picture(k), axis=2) for k in range(2)]
    assert 0.01 < changed[0].mean() < 0.5
    assert np.mean(changed[0] != changed[1]) < 0.02


def test_an_unknown_fault_is_named_with_those_that_there_are() -> None:
    with pytest.raises(ValueError, match=r"'melted', wanted one of black, white"):
        make_fault("melted")


def test_the_check_learns_from_faults_that_there_are_and_from_each_for_one_reason() -> None:
    taught = [name for names in REASONS.values() for name in names]
    assert len(set(taught)) == len(taught)
    assert set(taught) <= set(FAULTS)
