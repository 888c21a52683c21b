"""The gauges follow the table of the affordances."""

from __future__ import annotations

import math

import numpy as np
import pytest
from PIL import Image as Picture
from PIL import ImageDraw

from caldrive.affordances import BY_NAME
from caldrive.datatypes import Affordances, Image
from caldrive.visualization.gauges import (
    AMBER,
    BAR_LEFT,
    BAR_RIGHT,
    BLUE,
    GAUGES,
    RED,
    draw_frame,
    draw_gauges,
    value_text,
)

MIDDLE = (BAR_LEFT + BAR_RIGHT) / 2


def drawn(seen: Affordances | None, true: Affordances | None = None) -> Image:
    picture = Picture.new("RGB", (960, 224))
    draw = ImageDraw.Draw(picture)
    draw_frame(draw, truth=true is not None)
    draw_gauges(draw, seen, true)
    return np.asarray(picture)


def columns(image: Image, color: tuple[int, int, int]) -> list[int]:
    """From which to which column a colour is found."""
    found = np.flatnonzero((image == color).all(-1).any(0))
    return [int(found.min()), int(found.max())] if len(found) else []


def test_every_gauge_is_that_of_an_affordance() -> None:
    assert set(GAUGES) <= set(BY_NAME)


@pytest.mark.parametrize(
    ("name", "value", "text"),
    [
        ("hazard_stop", 0.25, "25 %"),
        ("speed_sign", 60.0, "60"),
        ("speed_sign", 0.0, "none"),
        ("vehicle_distance", 12.34, "12.3 m"),
        ("relative_angle", math.radians(-5), "-5.0°"),
        ("center_distance", 0.126, "+0.13 m"),
        ("center_distance", math.nan, "?"),
        ("red_light", None, "-"),
    ],
)
def test_values_are_written_in_the_units_that_people_read(name: str, value: float | None, text: str) -> None:
    assert value_text(BY_NAME[name], value) == text


def test_what_lies_to_the_left_grows_to_the_left() -> None:
    left, right = (columns(drawn(Affordances(center_distance=side)), BLUE) for side in (1.0, -1.0))
    assert left[0] < MIDDLE - 20
    assert left[1] <= MIDDLE + 1
    assert right[0] >= MIDDLE - 1
    assert right[1] > MIDDLE + 20


def test_the_bars_end_where_the_range_does() -> None:
    assert columns(drawn(Affordances(hazard_stop=1.0)), RED) == pytest.approx([BAR_LEFT, BAR_RIGHT], abs=2)
    assert columns(drawn(Affordances(vehicle_distance=0.0)), AMBER) == pytest.approx([BAR_LEFT, BAR_RIGHT], abs=2)
    assert columns(drawn(Affordances(vehicle_distance=50.0)), AMBER) == []


def test_the_sign_that_is_seen_is_framed_and_so_is_the_true_one() -> None:
    none, seen, both = (
        int((drawn(Affordances(speed_sign=sign), Affordances(speed_sign=true)) == RED).all(-1).sum())
        for sign, true in ((None, None), (30, None), (30, 90))
    )
    assert 0 == none < seen < both
