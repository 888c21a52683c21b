"""Of a drive those moments become key frames that tell something new."""

from __future__ import annotations

from collections.abc import Callable

from caldrive.collection.recorder import KeyFrameSelector
from caldrive.datatypes import Affordances

STREET = Affordances()


def taken(
    wanted: int, tailgating: bool = False, speed: Callable[[int], float] = lambda k: 0.0,
    labels: Callable[[int], Affordances] = lambda k: STREET,
) -> list[int]:  # fmt: skip
    """The key frames among as many moments as a drive may last, until there are enough."""
    frames, found = KeyFrameSelector(wanted, tailgating), list[int]()
    for k in range(frames.max_steps):
        if frames.select(labels(k), speed(k)):
            found.append(k)
        if frames.selected == wanted:
            break
    return found


def test_moments_in_which_the_car_stands_for_long_tell_little() -> None:
    found = taken(200, speed=lambda k: 5.0 if k > 200 else 0.0)
    standing = [k for k in found if k <= 200]
    assert standing == [*range(15), *range(134, 143)]
    assert found[len(standing) :] == list(range(201, 401 - len(standing)))  # twenty seconds that tell something


def test_a_light_that_changes_before_a_standing_car_tells_something() -> None:
    found = taken(100, labels=lambda k: Affordances(red_light=float(0 < k <= 60)))
    assert found == [*range(17), *range(61, 77), *range(196, 200)]


def test_a_tailgater_tells_of_the_beginning_and_of_the_cars_met() -> None:
    found = taken(
        50,
        tailgating=True,
        speed=lambda k: 5.0,
        labels=lambda k: Affordances(vehicle_distance=20.0 if 100 < k <= 110 else 40.0),
    )
    assert found == [*range(8), *range(101, 111)]


def test_an_episode_in_which_the_car_stands_on_ends() -> None:
    assert KeyFrameSelector(50, tailgating=False).max_steps == 100
    assert KeyFrameSelector(50, tailgating=True).max_steps == 300
