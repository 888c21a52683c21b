"""Of a drive those moments are recorded that tell something new."""

from __future__ import annotations

from types import SimpleNamespace

from caldrive.datatypes import Affordances
from caldrive.driving.moments import moments


def standing_world() -> SimpleNamespace:
    truth = SimpleNamespace(contacts=(), route_done=0.0, route_length=100.0, affordances=Affordances())
    return SimpleNamespace(dt=0.1, observation=SimpleNamespace(speed=0.0), truth=lambda: truth)


def test_moments_in_which_the_car_stands_for_long_tell_little() -> None:
    world = standing_world()
    told = []
    for index, _, telling in moments(world, 20.0, False):  # type: ignore[arg-type]
        world.observation.speed = 5.0 if index >= 200 else 0.0
        told += [index] if telling else []
    standing = [index for index in told if index <= 200]
    assert standing == [*range(15), *range(134, 143)]
    assert told[len(standing) :] == list(range(201, 401 - len(standing)))  # twenty seconds that tell something


def test_a_light_that_changes_before_a_standing_car_tells_something() -> None:
    world, told = standing_world(), []
    for index, _, telling in moments(world, 10.0, False):  # type: ignore[arg-type]
        world.truth().affordances = Affordances(red_light=float(index < 60))
        told += [index] if telling else []
    assert told == [*range(17), *range(61, 77), *range(196, 200)]


def test_a_tailgater_tells_of_the_beginning_and_of_the_cars_met() -> None:
    world, told = standing_world(), []
    world.observation.speed = 5.0
    for index, _, telling in moments(world, 5.0, True):  # type: ignore[arg-type]
        world.truth().affordances = Affordances(vehicle_distance=20.0 if 100 <= index < 110 else 40.0)
        told += [index] if telling else []
    assert told == [*range(8), *range(101, 111)]
    assert index == 299  # six times as long as an episode that tells all the time


def test_an_episode_in_which_the_car_stands_on_ends() -> None:
    world = standing_world()
    assert len(list(moments(world, 5.0, False))) == 100  # type: ignore[arg-type]
