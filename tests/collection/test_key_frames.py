"""Of a drive those steps become key frames that show something new."""

from __future__ import annotations

from collections.abc import Callable

from caldrive.collection.recorder import KeyFrameSelector
from caldrive.datatypes import Affordances

STREET = Affordances()


def selected(
    wanted: int, tailgating: bool = False, speed: Callable[[int], float] = lambda k: 0.0,
    labels: Callable[[int], Affordances] = lambda k: STREET,
) -> list[int]:  # fmt: skip
    """The key frames among as many steps as a drive may last, until there are enough."""
    selector, key_frames = KeyFrameSelector(wanted, tailgating), list[int]()
    for k in range(selector.max_steps):
        if selector.select(labels(k), speed(k)):
            key_frames.append(k)
        if selector.selected == wanted:
            break
    return key_frames


def test_steps_in_which_the_car_stands_for_long_show_little() -> None:
    key_frames = selected(200, speed=lambda k: 5.0 if k > 200 else 0.0)
    standing = [k for k in key_frames if k <= 200]
    assert standing == [*range(15), *range(134, 143)]
    assert key_frames[len(standing) :] == list(range(201, 401 - len(standing)))  # twenty seconds that show something


def test_a_light_that_changes_before_a_standing_car_shows_something() -> None:
    key_frames = selected(100, labels=lambda k: Affordances(red_light=float(0 < k <= 60)))
    assert key_frames == [*range(17), *range(61, 77), *range(196, 200)]


def test_a_tailgating_drive_keeps_its_first_steps_and_the_cars_met() -> None:
    key_frames = selected(
        50,
        tailgating=True,
        speed=lambda k: 5.0,
        labels=lambda k: Affordances(vehicle_distance=20.0 if 100 < k <= 110 else 40.0),
    )
    assert key_frames == [*range(8), *range(101, 111)]


def test_an_episode_in_which_the_car_stands_on_ends() -> None:
    assert KeyFrameSelector(50, tailgating=False).max_steps == 100
    assert KeyFrameSelector(50, tailgating=True).max_steps == 300
