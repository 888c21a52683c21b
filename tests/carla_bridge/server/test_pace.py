"""When the clock moves the world, by a clock that the test turns."""

from __future__ import annotations

import pytest

from caldrive.carla_bridge.server import pace
from caldrive.carla_bridge.server.pace import FIRST_FRAME, FREE_STEP, GRACE, LONGEST_GRACE, Pace


class Clock:
    def __init__(self) -> None:
        self.now = 100.0

    def monotonic(self) -> float:
        return self.now


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    made = Clock()
    monkeypatch.setattr(pace, "time", made)
    return made


def test_a_world_that_nobody_asked_for_anything_stands(clock: Clock) -> None:
    assert Pace().left() > 1e9


def test_a_client_that_connects_gets_a_frame_soon_and_then_has_time_before_the_first_step(clock: Clock) -> None:
    found = Pace()
    found.hear()
    clock.now += 0.1
    found.hear()
    assert found.owes_frame
    assert found.left() == pytest.approx(FIRST_FRAME)
    clock.now += FIRST_FRAME
    found.show()
    assert (found.stands, found.owes_frame) == (True, False)
    assert found.left() == pytest.approx(GRACE)


def test_calls_put_the_first_step_off_and_not_for_ever(clock: Clock) -> None:
    found = Pace()
    found.hear()
    found.show()
    for _ in range(20):
        found.hear()
        assert found.left() <= GRACE
        clock.now += 0.9 * GRACE
    assert clock.now > 100.0 + LONGEST_GRACE
    assert found.left() == 0.0


def test_the_first_frame_of_a_loaded_world_comes_whatever_the_client_calls(clock: Clock) -> None:
    found = Pace()
    found.begin_loaded()
    for _ in range(20):  # a client that loads asks for the settings until it has come
        clock.now += GRACE / 20
        found.hear()
    assert found.left() == pytest.approx(0.0, abs=1e-6)
    found.show()
    assert (found.stands, found.owes_frame) == (True, False)
    assert found.left() == pytest.approx(GRACE)


def test_steps_by_the_clock_follow_each_other_and_missed_ones_are_not_made_up_for(clock: Clock) -> None:
    found = Pace()
    found.hear()
    found.show()
    clock.now += GRACE
    found.step(None)
    assert not found.stands
    assert found.left() == pytest.approx(FREE_STEP)
    clock.now += 60.0
    found.step(0.1)
    assert found.left() == 0.0
    found.step(0.1)
    assert found.left() == pytest.approx(0.1)
