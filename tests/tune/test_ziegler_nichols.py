"""The assistant on loops whose ultimate gain and period are known, and on the car's."""

from __future__ import annotations

import math

import numpy as np
import pytest

from caldrive.control.pid import PIDGains
from caldrive.datatypes import DT, KMH
from caldrive.tune.ziegler_nichols import Response, Ultimate, find_ultimate, proposed, speed_response
from caldrive.world.traffic.ego import SUBSTEP, VehicleConfig

STEP = 0.01  # s


def chain(n: int, gain: float) -> Response:
    """A P controller around n first-order lags of 1 s each, after a disturbance: exact from step to step."""
    system = np.diag(-np.ones(n)) + np.diag(np.ones(n - 1), -1)
    system[0, -1] -= gain
    values, vectors = np.linalg.eig(system)
    start = np.linalg.solve(vectors, np.eye(n)[-1])
    times = np.arange(0, 120, STEP)
    response: Response = (vectors[-1] * start * np.exp(np.outer(times, values))).sum(1).real
    return response


def test_three_lags_oscillate_at_a_gain_of_8() -> None:
    found = find_ultimate(lambda gain: chain(3, gain), STEP)  # (s + 1)³ + K = 0 at s = ±√3 j
    assert found.gain == pytest.approx(8.0, rel=0.01)
    assert found.period == pytest.approx(math.tau / math.sqrt(3), rel=0.01)


def test_four_lags_oscillate_at_a_gain_of_4() -> None:
    found = find_ultimate(lambda gain: chain(4, gain), STEP)  # (s + 1)⁴ + K = 0 at s = ±j
    assert (found.gain, found.period) == pytest.approx((4.0, math.tau), rel=0.01)


def test_a_single_lag_never_oscillates() -> None:
    with pytest.raises(ValueError, match=r"found no oscillation up to K_p = 10000, wanted one"):
        find_ultimate(lambda gain: np.exp(-(1 + gain) * np.arange(0, 10, STEP)), STEP)


def test_the_papers_times_are_gains_in_the_parallel_form() -> None:
    like = PIDGains(0.0, 0.0, low=-0.3)
    gains = proposed("PID, as in the paper", Ultimate(gain=2.0, period=4.0, responses={}), like)
    standard = 1.2, 4.0 / 2, 4.0 / 8  # K_p, T_i, T_d as the supplement prints them
    assert (gains.kp, gains.kp / gains.ki, gains.kd / gains.kp) == pytest.approx(standard)
    assert (gains.low, gains.high) == (-0.3, 1.0)


def closed_loop_radius(gain: float) -> float:
    """Of the car's speed loop around 30 km/h, linear: the largest eigenvalue's magnitude from step to step."""
    car, speed = VehicleConfig(), 30 * KMH
    thrust = car.max_acceleration * (1 - speed / car.top_speed) / KMH  # km/h per s
    hold = (car.drag * speed**2 + car.rolling) / (thrust * KMH)
    fade = 2 * car.drag * speed + hold * car.max_acceleration / car.top_speed
    share, n = 1 - math.exp(-SUBSTEP / car.throttle_lag), round(DT / SUBSTEP)
    substep = [  # speed, the throttle's response, the throttle
        [1 - SUBSTEP * fade, SUBSTEP * thrust * (1 - share), SUBSTEP * thrust * share],
        [0.0, 1 - share, share],
        [0.0, 0.0, 1.0],
    ]
    step = np.linalg.matrix_power(np.array(substep), n)
    return float(np.abs(np.linalg.eigvals(step[:2, :2] - gain * np.outer(step[:2, 2], (1.0, 0.0)))).max())


def test_the_cars_speed_loop_is_on_the_edge_where_a_linear_one_is() -> None:
    found = find_ultimate(speed_response, DT)
    assert closed_loop_radius(0.99 * found.gain) < 1.0 < closed_loop_radius(1.01 * found.gain)
    assert 0.4 < found.period < 1.2  # s: the throttle's lag of 0.25 s and a step of 0.1 s
