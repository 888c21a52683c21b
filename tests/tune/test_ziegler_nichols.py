"""The assistant on loops whose ultimate gain and period are known, and on the car's."""

from __future__ import annotations

import math

import numpy as np
import pytest

from caldrive.control.pid import PIDGains
from caldrive.datatypes import DT
from caldrive.tune.ziegler_nichols import Response, Ultimate, find_ultimate, proposed, speed_response

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


def test_the_cars_speed_loop_is_stable_below_and_unstable_above() -> None:
    found = find_ultimate(speed_response, DT)
    assert 1.0 < found.gain < 4.0  # per km/h, many times the default's 0.09
    assert 0.4 < found.period < 1.2  # s: the throttle's lag of 0.25 s and a step of 0.1 s
    for factor, grows in ((0.8, False), (1.1, True)):
        values = speed_response(factor * found.gain)
        swing = [np.ptp(part) for part in np.split(values[:150], 3)]
        assert bool(swing[2] > swing[1]) is grows
