"""The right edge of the road, found and tracked."""

from __future__ import annotations

import math

import numpy as np
import pytest

from caldrive.agents.modular_pipeline.ground import SHAPE, GroundGrid, cell_middles
from caldrive.agents.modular_pipeline.road_edge import (
    ACROSS,
    LOST,
    ROAD,
    STATIONS,
    Edge,
    edge_points,
    fit_edge,
    opening,
)
from caldrive.agents.modular_pipeline.scene import SceneClass
from caldrive.datatypes import Pose
from tests.agents.modular_pipeline.grids import STREET, ground

CAR = Pose(0.0, 0.0, 0.0)
EXPECTED = Edge(-2.0)


def found(grid: GroundGrid, looks: int = 40) -> Edge:
    """The edge after some looks at the same ground."""
    edge = EXPECTED
    for _ in range(looks):
        edge = fit_edge(edge_points(grid, edge, CAR), edge, ROAD)
    return edge


@pytest.mark.parametrize("a", [-1.0, -2.0, -3.2])
def test_the_edge_is_found_where_it_is(a: float) -> None:
    edge = found(ground([(-1.0, 30.0, a, a + 8.0)]))
    assert edge.at(STATIONS) == pytest.approx(np.full(len(STATIONS), a), abs=0.1)
    assert edge.points == len(STATIONS)


@pytest.mark.parametrize("radius", [16.0, -24.0])
def test_a_bend_is_followed(radius: float) -> None:
    """The right edge bends to the right round a centre at -radius, or to the left."""
    x, y = cell_middles().T
    gap = np.hypot(x, y - (-2.0 - radius)) - abs(radius)  # m outside of the edge's circle
    road = (gap > 0) & (gap < 8) if radius > 0 else (gap < 0) & (gap > -8)
    classes = np.eye(5, dtype=np.float32)[np.where(road, SceneClass.ROAD, SceneClass.SIDEWALK)]
    edge = found(GroundGrid(classes.reshape(*SHAPE, -1), np.ones(SHAPE, bool)))
    s = np.array([4.0, 7.0, 10.0])
    wanted = -2.0 - math.copysign(1, radius) * (abs(radius) - np.sqrt(radius**2 - s**2))
    assert edge.at(s) == pytest.approx(wanted, abs=0.25)
    assert math.copysign(1, edge.c) == -math.copysign(1, radius)


def test_where_nothing_is_seen_the_edge_stays_where_it_was() -> None:
    nothing = ground([STREET], seen=(0.0, 1.0, 0.0, 1.0))
    assert np.isnan(edge_points(nothing, EXPECTED, CAR)).all()
    edge = fit_edge(edge_points(nothing, EXPECTED, CAR), EXPECTED, ROAD)
    assert (edge.a, edge.b, edge.c, edge.points) == (-2.0, 0.0, 0.0, 0)


def test_a_parked_car_hides_the_edge_and_does_not_move_it() -> None:
    grid = ground([STREET], moving=[(5.0, 24.0, -9.0, -0.9)])
    assert np.isfinite(edge_points(grid, EXPECTED, CAR)).sum() <= 3
    assert found(grid).at(STATIONS) == pytest.approx(-2.0, abs=0.15)


def test_an_opening_to_the_right_does_not_lead_astray_across_a_junction() -> None:
    """The kerb ends 7 m ahead, and goes on after the side road."""
    edge = EXPECTED
    grid = ground([STREET, (7.0, 15.0, -22.0, 0.0)])
    for _ in range(20):
        edge = fit_edge(edge_points(grid, edge, CAR), edge, ACROSS)
    assert edge.at(STATIONS) == pytest.approx(-2.0, abs=0.15)


def test_an_edge_is_where_it_was_when_the_car_moves_on() -> None:
    motion = Pose(1.0, 0.1, 0.05)
    edge = Edge(-2.0, 0.1).moved(motion)
    assert edge.at(np.array([0.0]))[0] == pytest.approx(-2.0 + 0.1 - 0.1, abs=0.06)
    assert edge.b == pytest.approx(0.05, abs=0.005)


@pytest.mark.parametrize(("side", "box"), [(0.0, (9.0, 17.0, -22.0, 0.0)), (8.0, (9.0, 17.0, 0.0, 22.0))])
def test_a_side_road_opens_where_it_begins(side: float, box: tuple[float, float, float, float]) -> None:
    stations = np.arange(4.5, 17.0, 0.5)
    assert opening(ground([STREET, box]), EXPECTED, side=side, stations=stations) == pytest.approx(9.0, abs=0.6)
    assert opening(ground([STREET]), EXPECTED, side=side, stations=stations) is None


def test_somebody_on_the_sidewalk_opens_no_road() -> None:
    grid = ground([STREET], moving=[(9.0, 24.0, -9.0, -2.5)])
    assert opening(grid, EXPECTED, side=0.0, stations=np.arange(4.5, 17.0, 0.5)) is None


def test_an_edge_that_was_lost_is_found_again() -> None:
    grid = ground([(-1.0, 30.0, -4.5, 3.5)])
    edge = fit_edge(edge_points(grid, EXPECTED, CAR), EXPECTED, LOST)
    assert edge.at(STATIONS) == pytest.approx(-4.5, abs=0.3)


def test_waypoints_lie_beside_the_edge() -> None:
    points = Edge(-2.0, 0.5).beside(2.0, np.array([0.0, 4.0]))
    slope = math.atan(0.5)
    assert points[1] - points[0] == pytest.approx(np.array([4.0, 2.0]))
    assert points[0] == pytest.approx((-2 * math.sin(slope), -2 + 2 * math.cos(slope)))
