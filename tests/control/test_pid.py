from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from caldrive.control.pid import PIDGains, PIDState, pid_step

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
    state = PIDState()
    for error in errors:
        state, output = pid_step(gains, state, error, 0.1)
        assert gains.low <= output <= gains.high
        assert gains.low <= state.integral <= gains.high


def test_parallel_form_adds_three_terms() -> None:
    gains = PIDGains(0.1, 0.2, 0.05, low=-10, high=10, filter_time=0.0)
    state, first = pid_step(gains, PIDState(), 1.0, 0.1)
    _, second = pid_step(gains, state, 2.0, 0.1)
    assert first == pytest.approx(0.1 * 1 + 0.2 * 0.1)
    assert second == pytest.approx(0.1 * 2 + 0.2 * (0.1 + 0.2) + 0.05 * 10)


def test_the_first_error_does_not_kick_the_derivative() -> None:
    assert pid_step(PIDGains(0, 0, 1), PIDState(), 5.0, 0.1)[1] == 0.0


def test_integral_does_not_wind_up_at_a_limit() -> None:
    gains, state = PIDGains(0.1, 0.1), PIDState()
    for _ in range(1000):
        state, output = pid_step(gains, state, 50.0, 0.1)
        assert output == 1.0
    assert state.integral == 0.0
    assert pid_step(gains, state, -1.0, 0.1)[1] < 0.0
