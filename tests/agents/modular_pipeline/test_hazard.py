"""The hazard stop: how much of what moves lies in the way."""

from __future__ import annotations

import numpy as np
import pytest

from caldrive.agents.modular_pipeline.agent import BUMPER, THRESHOLD, corridor, moving_area, stopping_distance
from tests.agents.modular_pipeline.grids import STREET, ground

STRAIGHT = np.stack((np.arange(1.0, 16.0, 0.5), np.zeros(30)), axis=1)


def test_the_stopping_distance_grows_with_the_speed() -> None:
    assert stopping_distance(5.0) - stopping_distance(0.0) == pytest.approx(25 / 8 + 2.5)


def test_what_moves_in_the_corridor_counts_by_its_area() -> None:
    grid = ground([STREET], moving=[(6.0, 7.0, -0.5, 0.5)])
    assert moving_area(grid, STRAIGHT, 0.0) == pytest.approx(1.0, abs=0.3)


@pytest.mark.parametrize(
    ("box", "speed", "stops"),
    [
        ((5.0, 6.0, -0.5, 0.5), 0.0, True),
        ((5.0, 6.0, 1.6, 3.5), 5.0, False),  # the oncoming lane
        ((5.0, 6.0, -3.0, -1.6), 5.0, False),  # the kerb
        ((14.0, 15.0, -1.0, 1.0), 0.0, False),  # far enough
        ((13.0, 14.0, -1.0, 1.0), 6.0, True),
    ],
)
def test_who_is_in_the_way_stops_the_car(box: tuple[float, float, float, float], speed: float, stops: bool) -> None:
    assert (moving_area(ground([STREET], moving=[box]), STRAIGHT, speed) > THRESHOLD) == stops


def test_the_corridor_bends_with_the_waypoints() -> None:
    angle = np.linspace(0.1, 1.2, 30)
    bend = np.stack((9 * np.sin(angle), 9 * np.cos(angle) - 9), axis=1)  # a right turn
    ahead, aside = [(7.5, 8.5, -1.0, 1.0)], [(6.0, 7.0, -4.5, -3.0)]
    assert moving_area(ground([STREET], moving=ahead), bend, 3.0) < THRESHOLD
    assert moving_area(ground([STREET], moving=aside), bend, 3.0) > THRESHOLD
    places = corridor(bend, BUMPER + 8.0)
    assert places.shape[1:] == (9, 2)


def test_a_way_without_waypoints_ahead_has_no_corridor() -> None:
    assert moving_area(ground([STREET]), STRAIGHT - 20.0, 0.0) == 0.0
