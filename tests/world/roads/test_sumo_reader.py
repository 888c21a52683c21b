"""Networks that no town can be made of are refused with the reason."""

from __future__ import annotations

import math

import numpy as np
import pytest

from caldrive.geometry import Polyline
from caldrive.world.roads import sumo_reader
from caldrive.world.roads.network import Lane


def lane(length: float = 100.0, x: float = 0.0, width: float = 4.0, internal: bool = False) -> dict[str, Lane]:
    line = Polyline(np.array([(x, 0.0), (x + length, 0.0)]))
    return {"a_0": Lane("a_0", line, width=width, limit=50.0, internal=internal)}


REFUSED = {
    "none": ({}, "no lane of type driving"),
    "only a junction": (lane(internal=True), "no lane of type driving"),
    "a wide lane": (lane(width=1e5), "its lane a_0 is 100000 m wide"),
    "a lane without width": (lane(width=0.0), "its lane a_0 is 0 m wide"),
    "no width at all": (lane(width=math.nan), "its lane a_0 is nan m wide"),
    "a far lane": (lane(x=1e10), "roads more than 10000 km from its origin"),
    "a country": (lane(length=1e7 - 1), "it reaches over 10000 km, more than 30: cut a smaller part out of it"),
}


@pytest.mark.parametrize("kind", REFUSED)
def test_lanes_that_make_no_town_are_refused(kind: str) -> None:
    lanes, message = REFUSED[kind]
    with pytest.raises(ValueError, match=message):
        sumo_reader._require_town(lanes)


def test_many_lanes_are_refused_by_their_length_together() -> None:
    lanes = {str(k): lane(length=20_000.0)["a_0"] for k in range(16)}
    with pytest.raises(ValueError, match="it has lanes of 320 km, more than 300"):
        sumo_reader._require_town(lanes)


@pytest.mark.parametrize("points", [[(0, 0), (0, 0)], [(0, 0), (math.nan, 1)], [(0, 0), (math.inf, 0)], [(1, 1)]])
def test_places_and_infinite_points_are_no_line(points: list[tuple[float, float]]) -> None:
    with np.errstate(invalid="ignore"):
        assert not sumo_reader._is_line(np.array(points, dtype=float))
