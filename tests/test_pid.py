from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from caldrive.config import PIDGains
from caldrive.control.pid import PID, PIDState, pid_step

GAINS = st.builds(
    PIDGains,
    kp=st.floats(0, 1),
    ki=st.floats(0, 1),
    kd=st.floats(0, 1),
    low=st.floats(-1, 0),
    high=st.floats(0.1, 1),
)
ERRORS = st.lists(st.floats(-100, 100), min_size=1, max_size=50)


@given(GAINS, ERRORS)
def test_output_and_integral_stay_within_the_limits(gains: PIDGains, errors: list[float]) -> None:
    pid = PID(gains, 0.1)
    for error in errors:
        assert gains.low <= pid.step(error) <= gains.high
        assert gains.low <= pid.state.integral <= gains.high


def test_parallel_form_adds_three_terms() -> None:
    gains = PIDGains(0.1, 0.2, 0.05, low=-10, high=10, filter_time=0.0)
    state, first = pid_step(gains, PIDState(), 1.0, 0.1)
    _, second = pid_step(gains, state, 2.0, 0.1)
    assert first == pytest.approx(0.1 * 1 + 0.2 * 0.1)
    assert second == pytest.approx(0.1 * 2 + 0.2 * (0.1 + 0.2) + 0.05 * 10)


def test_the_first_error_does_not_kick_the_derivative() -> None:
    assert pid_step(PIDGains(0, 0, 1), PIDState(), 5.0, 0.1)[1] == 0.0


def test_integral_does_not_wind_up_at_a_limit() -> None:
    pid = PID(PIDGains(0.1, 0.1), 0.1)
    for _ in range(1000):
        assert pid.step(50.0) == 1.0
    assert pid.state.integral == 0.0
    assert pid.step(-1.0) < 0.0


def test_reset_forgets_the_past() -> None:
    pid = PID(PIDGains(0.1, 0.1, 0.1), 0.1)
    first = pid.step(1.0)
    pid.step(3.0)
    pid.reset()
    assert pid.step(1.0) == first
