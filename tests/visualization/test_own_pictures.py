"""The video of a person's own pictures: the picture as it is, its gauges, and what the network was given."""

from __future__ import annotations

import math

import numpy as np

from caldrive.datatypes import Affordances, Command, Image
from caldrive.visualization.gauges import RED
from caldrive.visualization.hud import HEADER, PANEL
from caldrive.visualization.own_pictures import HIGHEST, NETWORK_VIEW, WIDTH, SeenFrames, SeenPicture

GREEN_IMAGE = np.full((88, 200, 3), (10, 222, 30), np.uint8)


def frame(
    height: int = 360,
    width: int = 800,
    rows: tuple[int, int] | None = None,
    affordances: Affordances | None = Affordances(),  # noqa: B008 (frozen)
    frames: SeenFrames | None = None,
) -> Image:
    picture = np.full((height, width, 3), 150, np.uint8)
    note = "" if affordances else "the image is black"
    seen = SeenPicture("1", 0.0, picture, rows or (0, height), GREEN_IMAGE, affordances, note)
    return (frames or SeenFrames("a caption", Command.LEFT)).draw(seen)


def test_the_picture_stands_whole_between_caption_and_gauges() -> None:
    image = frame()
    assert image.shape == (HEADER + 432 + PANEL, WIDTH, 3)
    assert (image[HEADER : HEADER + 432] == 150).all()


def test_rows_that_the_network_does_not_look_at_are_darker() -> None:
    view = frame(height=400, width=800, rows=(100, 300))[HEADER:-PANEL]
    assert (view[10] == 50).all()
    assert (view[240] == 150).all()
    assert (view[-10] == 50).all()


def test_frames_keep_their_size_when_pictures_change_theirs_and_all_sides_are_even() -> None:
    for first in ((360, 800), (1920, 1080), (75, 1001), (333, 777)):
        frames = SeenFrames("", Command.STRAIGHT)
        sizes = {frame(*size, frames=frames).shape for size in (first, (360, 800), (801, 601))}
        assert len(sizes) == 1
        height = sizes.pop()[0]
        assert height % 2 == 0
        assert height <= HEADER + HIGHEST + PANEL


def test_what_the_network_was_given_stands_beside_the_gauges() -> None:
    panel = frame()[-PANEL:]
    left, top, right, _ = NETWORK_VIEW
    assert (panel[top + 2 : top + 100, left + 2 : right - 2] == (10, 222, 30)).all()


def test_gauges_show_the_affordances() -> None:
    calm, hazard = (frame(affordances=Affordances(hazard_stop=value))[-PANEL:] for value in (0.0, 1.0))
    red = [int((panel == RED).all(-1).sum()) for panel in (calm, hazard)]
    assert red[1] > red[0] + 500


def test_a_picture_that_tells_nothing_is_marked() -> None:
    view = frame(affordances=None)[HEADER:-PANEL]
    assert int((view == RED).all(-1).sum()) > 500
    assert not (frame()[HEADER:-PANEL] == RED).all(-1).any()


def test_affordances_that_are_no_numbers_can_be_drawn() -> None:
    nothing = Affordances(math.nan, math.nan, None, math.nan, math.nan, math.nan)
    assert frame(affordances=nothing).shape == frame().shape
