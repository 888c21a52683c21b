"""A town's contact sheet: a row for each weather, or for each random look."""

from __future__ import annotations

import numpy as np
import pytest

from caldrive.collection.config import CollectConfig
from caldrive.datatypes import Image
from caldrive.visualization.contact_sheet import (
    CAPTION,
    MARGIN,
    RECORDED,
    cars_and_people,
    contact_sheet,
    viewpoints,
    whole_town,
)
from caldrive.world.roads.network import RoadNetwork
from caldrive.world.roads.towns import load_roads

SIZE = (64, 32)


def images(sheet: Image, row: int) -> Image:
    """The images of a row, without their captions."""
    top = MARGIN + row * (SIZE[1] + CAPTION + MARGIN) + CAPTION
    return sheet[top : top + SIZE[1]].astype(int)


def test_there_is_a_row_for_each_weather_and_a_column_for_each_viewpoint() -> None:
    sheet = contact_sheet("town02", SIZE, (1, 13))
    width = MARGIN + 3 * (64 + MARGIN)
    below = whole_town(load_roads("town02"), width)
    assert sheet.shape == (MARGIN + 2 * (32 + CAPTION + MARGIN) + len(below), width, 3)
    assert (sheet[-len(below) :] == below).all()
    assert np.abs(images(sheet, 0) - images(sheet, 1)).mean() > 5


def test_there_is_a_row_for_each_random_look() -> None:
    sheet = contact_sheet("town01", SIZE, (1,), randomised=2)
    usual = contact_sheet("town01", SIZE, (1,))
    first, second, own = images(sheet, 0), images(sheet, 1), images(usual, 0)
    assert len(sheet) == len(usual) + 32 + CAPTION + MARGIN
    assert min(np.abs(first - second).mean(), np.abs(first - own).mean(), np.abs(second - own).mean()) > 5


def test_random_looks_are_shown_in_the_weathers_in_which_they_are_recorded(monkeypatch: pytest.MonkeyPatch) -> None:
    two = contact_sheet("town01", SIZE, randomised=2)
    assert set(RECORDED) == set(CollectConfig().weathers)
    monkeypatch.setattr("caldrive.visualization.contact_sheet.RECORDED", (1, 13))
    other = contact_sheet("town01", SIZE, randomised=2)
    assert (images(two, 0) == images(other, 0)).all()
    assert np.abs(images(two, 1) - images(other, 1)).mean() > 2


def test_viewpoints_show_a_light_a_sign_and_a_bend(town: RoadNetwork) -> None:
    places = dict(viewpoints(town))
    assert list(places) == ["light", "sign", "bend"]
    for name in ("light", "bend"):
        town.lane_at(places[name])
    cars, people = cars_and_people(places["light"])
    assert (cars[0].speed, [person.on_road for person in people]) == (0.0, [True, False, False, False])


def test_an_unknown_town_is_refused() -> None:
    with pytest.raises(ValueError, match="type --town town01"):
        contact_sheet("mars")
