"""Attention drawn over an image."""

from __future__ import annotations

import numpy as np
import pytest

from caldrive.affordances import BY_NAME
from caldrive.explain.activation_maps import Attention, Reply
from caldrive.explain.overlay import (
    BAR,
    GREEN,
    LABEL,
    LARGER,
    RED,
    SMALLER,
    explained,
    likely_color,
    overlay,
    said,
    scale_of,
    still,
    true_text,
)

IMAGE = np.full((40, 80, 3), 100, np.uint8)
MAP = np.zeros((4, 8), np.float32)
MAP[1, 6] = 2.0


def towards(color: tuple[int, ...], pixel: np.ndarray) -> float:
    """How far a grey pixel was moved towards a colour, as a share of the way."""
    way = np.array(color, float) - 100
    return float((pixel - 100.0) @ way / (way @ way))


def test_probability_goes_from_green_to_red() -> None:
    assert (likely_color(0.0), likely_color(1.0)) == (GREEN, RED)
    reds = [likely_color(share)[0] for share in (0.0, 0.25, 0.5)]
    assert reds == sorted(reds)


def test_what_gets_no_attention_stays_as_it_is_and_the_rest_has_the_colour() -> None:
    drawn = overlay(IMAGE, MAP, scale=2.0, probability=1.0)
    assert (drawn[30:, :40] == IMAGE[30:, :40]).all()
    assert towards(RED, drawn[15, 65]) > 0.4
    weaker = overlay(IMAGE, MAP, scale=8.0, probability=1.0)  # the scale is the drive's, not the image's
    assert 0 < towards(RED, weaker[15, 65]) < 0.5 * towards(RED, drawn[15, 65])


@pytest.mark.parametrize(("sign", "color"), [(1, LARGER), (-1, SMALLER)])
def test_the_sign_of_a_values_attention_has_its_colour(sign: int, color: tuple[int, ...]) -> None:
    assert towards(color, overlay(IMAGE, sign * MAP, scale=2.0, probability=None)[15, 65]) > 0.4


def test_the_scale_passes_over_single_places() -> None:
    maps = [np.zeros((10, 20), np.float32) for _ in range(10)]
    maps[0][0, 0] = 100.0
    maps[1][:, :] = 1.0
    assert scale_of(maps) == pytest.approx(1.0)
    assert scale_of([]) > 0


def test_a_still_says_what_was_asked_and_how_far_back_the_block_looks() -> None:
    reply = Reply("red light", 0.25, 0.25, 1)
    one = explained(IMAGE, Attention(reply, (MAP,), (0,)), scale=2.0, width=320)
    two = explained(IMAGE, Attention(reply, (MAP, 0.1 * MAP), (2, 0)), scale=2.0, width=320)
    assert one.shape == (160 + BAR, 320, 3)
    assert (one[:160, 100:] != 0).any()
    assert (one[160:, 112:] != two[160:, 112:]).any()
    assert said(reply) == "red light: 25 %"
    assert said(Reply("relative angle", None, -0.2, 0)) == "relative angle: -0.20"


def test_a_strip_shows_every_frame_of_the_history_with_its_own_map_the_oldest_first() -> None:
    images = [np.full((40, 80, 3), level, np.uint8) for level in (60, 90, 120)]
    reply = Reply("hazard stop", 1.0, 1.0, 1)
    drawn = still(images, Attention(reply, (MAP, 0 * MAP), (2, 0)), scale=2.0, width=320)
    assert drawn.shape == (160 + BAR + 80 + BAR + LABEL, 320, 3)
    strip = drawn[160 + BAR : 160 + BAR + 80]
    assert (strip[70, 20] == 60).all()  # two frames back
    assert (strip[:, 160:] == 120).all()  # the present one, of which nothing counts
    assert strip[30, 130, 0] > 100  # where the map of the oldest is
    bars = drawn[160 + BAR + 80 : 160 + BAR + 80 + BAR]
    assert bars[:, :160].mean() > 2 * bars[:, 160:].mean()


def test_a_block_of_one_frame_has_no_strip() -> None:
    attention = Attention(Reply("red light", 0.25, 0.25, 1), (MAP,), (0,))
    assert (still([IMAGE], attention, 2.0, width=320) == explained(IMAGE, attention, 2.0, width=320)).all()


def test_the_truth_stands_beside_the_prediction() -> None:
    reply = Reply("speed sign 60", 0.25, 60.0, 2)
    assert said(reply, true_text(BY_NAME["speed_sign"], 90)) == "speed sign 60: 25 %, true: 90"
    assert [true_text(BY_NAME["red_light"], value) for value in (0.0, 1.0)] == ["no", "yes"]
    assert [true_text(BY_NAME["speed_sign"], value) for value in (None, 0, 30)] == ["none", "none", "30"]
    assert true_text(BY_NAME["center_distance"], -0.125) == "-0.12"
