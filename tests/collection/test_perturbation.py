"""Perturbations while recording are short, bounded, and leave the driver room to recover."""

from __future__ import annotations

from itertools import groupby

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from caldrive.collection.perturbation import ControlPerturbation, DelayedStart
from caldrive.datatypes import Control

controls = st.builds(
    lambda effort, steer: Control(max(effort, 0.0), max(-effort, 0.0), steer), st.floats(-1, 1), st.floats(-1, 1)
)


@given(st.integers(0, 2**32), st.lists(st.tuples(controls, st.floats(0, 25)), min_size=1, max_size=60))
def test_a_perturbation_is_bounded_and_ends(seed: int, drive: list[tuple[Control, float]]) -> None:
    perturbation, before, slowest = ControlPerturbation(np.random.default_rng(seed)), [0.0], 25.0
    for control, speed in drive:
        pushed = perturbation.apply(control, speed)  # a Control checks its own ranges
        before.append(control.steer)
        slowest = min(slowest, max(speed, 2.0))  # a push is as strong as the speed at its beginning allows
        assert abs(pushed.steer - control.steer) <= min(1.0, 36 / slowest**2) + 1e-9 or pushed.steer in before
        assert abs((pushed.throttle - pushed.brake) - (control.throttle - control.brake)) <= 0.5 + 1e-9


def pushes(speed: float, seed: int = 0, steps: int = 20_000, control: Control | None = None) -> list[Control]:
    perturbation, control = ControlPerturbation(np.random.default_rng(seed)), control or Control(throttle=0.4)
    return [perturbation.apply(control, speed) for _ in range(steps)]


def test_perturbations_are_short_and_leave_most_of_the_drive_alone() -> None:
    perturbed = [control != Control(throttle=0.4) for control in pushes(5.0)]
    assert 0.03 < np.mean(perturbed) < 0.3
    assert max(len(list(run)) for pushed, run in groupby(perturbed) if pushed) < 19


def test_a_slow_car_is_not_perturbed() -> None:
    assert set(pushes(1.0, steps=3000)) == {Control(throttle=0.4)}


def test_the_push_at_the_wheel_goes_to_both_sides_and_weakens_with_speed() -> None:
    slow, fast = (np.array([control.steer for control in pushes(speed)]) for speed in (5.0, 20.0))
    assert slow.max() > 0.25
    assert slow.min() < -0.25
    assert np.abs(fast).max() <= (6 / 20) ** 2 + 1e-9


def test_a_hard_braking_car_is_left_to_brake() -> None:
    assert {(control.throttle, control.brake) for control in pushes(8.0, control=Control(brake=0.8))} == {(0.0, 0.8)}


def test_a_wheel_that_stays_lets_the_car_turn_too_late() -> None:
    perturbation, steers = ControlPerturbation(np.random.default_rng(1)), []
    for k in range(2000):
        wanted = 0.0 if k % 20 < 10 else 0.5
        steers.append((wanted, perturbation.apply(Control(throttle=0.4, steer=wanted), 5.0).steer))
    assert (0.5, 0.0) in steers
    assert (0.0, 0.5) in steers


def standing_times(seed: int) -> list[int]:
    """Steps for which a driver stands on at each of two hundred lights that turned green."""
    start, delays = DelayedStart(np.random.default_rng(seed)), []
    for _ in range(200):
        speed, stood = 0.0, 0
        for _ in range(20):  # red
            assert start.apply(Control(brake=1.0), 0.0) == Control(brake=1.0)
        while (control := start.apply(Control(throttle=0.5), speed)).throttle == 0:
            stood += 1
        while speed < 3:
            assert control == Control(throttle=0.5)
            speed += 0.2
            control = start.apply(Control(throttle=0.5), speed)
        delays.append(stood)
    return delays


def test_a_late_start_is_late_in_half_of_the_cases_and_2_s_at_most() -> None:
    delays = standing_times(5)
    assert 80 < sum(stood > 0 for stood in delays) < 120
    assert {min(s for s in delays if s), max(delays)} <= set(range(5, 21))
    assert delays == standing_times(5)


def test_a_car_on_its_way_is_never_held() -> None:
    start = DelayedStart(np.random.default_rng(0))
    assert {start.apply(Control(throttle=0.2), 0.4) for _ in range(500)} == {Control(throttle=0.2)}


def test_who_has_braked_hard_brakes_on_in_half_of_the_cases() -> None:
    start, delays = DelayedStart(np.random.default_rng(3)), []
    for _ in range(200):
        start.apply(Control(brake=0.9), 4.0)
        braking = [start.apply(Control(throttle=0.3), 2.0).brake for _ in range(25)]
        assert braking == sorted(braking, reverse=True)
        delays.append(round(sum(braking)))
    assert 80 < sum(steps > 0 for steps in delays) < 120
    assert {min(s for s in delays if s), max(delays)} <= set(range(5, 21))


def test_who_brakes_on_until_the_car_stands_dreams_once() -> None:
    start, on_the_move = DelayedStart(np.random.default_rng(4)), []
    for _ in range(200):
        start.apply(Control(brake=0.9), 4.0)
        braking = [start.apply(Control(throttle=0.3), speed).brake > 0 for speed in (1.6, 0.8, *[0.0] * 48)]
        runs = [len(list(run)) for brakes, run in groupby(braking) if brakes]
        assert len(runs) <= 1
        assert set(runs) <= set(range(5, 21))
        on_the_move += runs if braking[0] else []
        start.apply(Control(throttle=0.3), 3.0)
    assert 80 < len(on_the_move) < 120


def test_who_has_braked_gently_goes_on() -> None:
    start = DelayedStart(np.random.default_rng(3))
    for _ in range(200):
        assert start.apply(Control(brake=0.3), 4.0) == Control(brake=0.3)
        assert start.apply(Control(throttle=0.3), 4.0) == Control(throttle=0.3)
