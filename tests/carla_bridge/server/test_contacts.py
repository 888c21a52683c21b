"""What clients' vehicles touch, and what stands before a sensor."""

from __future__ import annotations

import math

import pytest

from caldrive.carla_bridge.axes import Placement
from caldrive.carla_bridge.server.actors import Prop, box_of, description
from caldrive.carla_bridge.server.contacts import resolve_contacts, way_ahead
from caldrive.carla_bridge.server.vehicles import Vehicle, config_of
from caldrive.datatypes import ContactKind, PedestrianState, Pose
from caldrive.world.town import Obstacles
from caldrive.world.traffic.collisions import Obstacle
from caldrive.world.traffic.ego import EgoState

HERE = Pose(0.0, 0.0, 0.0)


def box(x: float, y: float, size: tuple[float, float] = (2.0, 2.0), heading: float = 0.0) -> Obstacle:
    return Obstacle(ContactKind.CAR, "box", Pose(x, y, heading), length=size[0], width=size[1])


def away(*near: Obstacle, radius: float = 0.5) -> float | None:
    found = way_ahead(HERE, 20.0, radius, near)
    return None if found is None else found[1]


def test_an_obstacle_is_as_far_away_as_its_nearest_point_in_the_way() -> None:
    assert away(box(10.0, 0.0)) == pytest.approx(9.0)
    assert away(box(12.0, 0.0), box(10.0, 0.0)) == pytest.approx(9.0)


def test_a_corner_that_is_nearer_but_beside_the_way_does_not_count() -> None:
    """A wall across the way at 45 degrees comes as near as 3 m, but not within half a metre of the line."""
    wall = box(10.0, 0.0, size=(20.0, 0.01), heading=math.pi / 4)
    assert away(wall) == pytest.approx(math.hypot(9.5, 0.5), abs=0.05)
    assert away(wall, radius=20.0) == pytest.approx(10 / math.sqrt(2), abs=0.05)


def test_what_stands_beside_the_way_or_beyond_it_or_behind_is_no_obstacle() -> None:
    assert away(box(10.0, 1.6)) is None
    assert away(box(21.3, 0.0)) is None
    assert away(box(-2.0, 0.0)) is None


def vehicle(pose: Pose, speed: float) -> Vehicle:
    size, state = config_of(4.0, 2.0), EgoState(pose, speed)
    return Vehicle(1, description("vehicle.audi.tt"), Placement(), config=size, state=state)


def test_the_impulse_of_a_hit_goes_away_from_what_is_hit() -> None:
    """A car that slides along a wall on its left at a small angle is pushed to the right, not back."""
    wall = Prop(2, description("static.prop.container"), Placement(x=0.0, y=2.0), box=box_of((40.0, 2.0, 2.0), 1.0))
    car = vehicle(Pose(0.0, 0.0, 0.1), speed=10.0)
    [hit] = resolve_contacts([car], [car.box_state()], [wall], Obstacles(()))
    x, y = hit.impulse
    assert y < 0.0
    assert abs(x) < 1e-6 * abs(y)
    assert math.hypot(x, y) == pytest.approx(hit.contact.impulse)
    assert car.state.pose.y < 0.0


def test_each_of_two_people_who_are_hit_is_pushed_ahead() -> None:
    car = vehicle(HERE, speed=10.0)
    people = [PedestrianState(Pose(2.1, y, 0.0), 0.0, 0.3, True, f"person{y}") for y in (-0.5, 0.5)]
    hits = resolve_contacts([car], [car.box_state(), *people], [], Obstacles(()))
    assert len(hits) == 2
    assert all(hit.impulse[0] < 0.0 and abs(hit.impulse[1]) < 1e-9 for hit in hits)
    assert 0.0 < car.state.speed < 10.0
