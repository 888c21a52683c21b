"""The tuning rule of Ziegler and Nichols, by which the paper's gains were found (supplement 1.2).

1. With K_i = K_d = 0, raise K_p until the loop oscillates without dying away: at the ultimate gain K_u.
2. Measure the period T_u of that oscillation.
3. Take the gains from a table of K_u and T_u.

The supplement prints K_p = 0.6 K_u, K_i = T_u / 2, K_d = T_u / 8. The last two are the times T_i and T_d of the
standard form K_p (e + 1/T_i ∫e dt + T_d de/dt). In the parallel form, which the controller has, the same is
K_i = 1.2 K_u / T_u and K_d = 0.075 K_u T_u.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from caldrive.control.pid import PIDGains, PIDState, pid_step
from caldrive.datatypes import DT, KMH, Control, Pose
from caldrive.world.traffic.ego import EgoState, VehicleConfig, advance

Response = NDArray[np.float64]  # (N,), a loop's output over time after a small disturbance
RULES: Mapping[str, tuple[float, float, float]] = {  # K_p / K_u, K_i T_u / K_u, K_d / (K_u T_u)
    "PID, as in the paper": (0.6, 1.2, 0.075),
    "PI": (0.45, 0.54, 0.0),
    "PID without overshoot": (0.2, 0.4, 1 / 15),  # the milder variant that textbooks give
}
FACTOR = 1.5  # by which the gain is raised
BISECTIONS = 20
LEAST, MOST = 1e-3, 1e4  # gains that are tried
DIED = 1e-6  # of its beginning: an oscillation as small as this is gone
STEADY = 0.98  # of its size that an oscillation keeps from one third of a response to the next
FEWEST_CROSSINGS = 4
CRUISE = 30 * KMH  # m/s around which the speed is controlled
DISTURBANCE = 0.02 * KMH  # m/s, so small that throttle and brake stay within their limits
DURATION = 30.0  # s


@dataclass(frozen=True)
class Ultimate:
    """A loop on the edge of stability: the gain K_u, the period T_u (s), and the responses that were tried, by gain."""

    gain: float
    period: float
    responses: Mapping[float, Response]


def find_ultimate(response: Callable[[float], Response], dt: float) -> Ultimate:
    """Raises the gain until the loop oscillates, then halves the interval around that gain.

    response: the loop's output (N,) at a gain K_p, dt s apart. Raises ValueError where no gain makes it oscillate.
    """
    tried: dict[float, Response] = {}
    gain = LEAST
    while not oscillates(tried.setdefault(gain, response(gain))):
        gain *= FACTOR
        if gain > MOST:
            raise ValueError(f"found no oscillation up to K_p = {MOST:g}, wanted one: this loop has no ultimate gain")
    low, high = gain / FACTOR, gain
    for _ in range(BISECTIONS):
        middle = (low + high) / 2
        if oscillates(tried.setdefault(middle, response(middle))):
            high = middle
        else:
            low = middle
    return Ultimate(high, period_of(tried[high], dt), tried)


def oscillates(values: Response) -> bool:
    """Whether a response swings on: in its last third no less than in the one before it."""
    third = len(values) // 3
    begin, middle, end = values[:third], values[third : 2 * third], values[2 * third :]
    swings = len(_upward(end)) >= FEWEST_CROSSINGS
    return bool(swings and np.std(end) > DIED * np.std(begin) and np.std(end) >= STEADY * np.std(middle))


def period_of(values: Response, dt: float) -> float:
    """Mean time between upward crossings of the mean, s, in the last two thirds of an oscillation."""
    return float(np.mean(np.diff(_upward(values[len(values) // 3 :])))) * dt


def _upward(values: Response) -> Response:
    """Where the values cross their mean upwards, in steps, between which they are interpolated."""
    offset = values - values.mean()
    (before,) = np.nonzero((offset[:-1] < 0) & (offset[1:] >= 0))
    places: Response = before + offset[before] / (offset[before] - offset[before + 1])
    return places


def proposed(rule: str, ultimate: Ultimate, like: PIDGains) -> PIDGains:
    """A rule's gains, with the limits and the filter of the PID that they are for."""
    p, i, d = RULES[rule]
    return replace(
        like, kp=p * ultimate.gain, ki=i * ultimate.gain / ultimate.period, kd=d * ultimate.gain * ultimate.period
    )


def speed_response(gain: float, car: VehicleConfig | None = None) -> Response:
    """The ego's speed (N,) in km/h, every DT s, at 30 km/h after a small disturbance, with a P controller.

    The loop is that of cruising and of following: error in km/h to throttle and brake, one step of delay between what
    is measured and what is done. The target lies as far above 30 km/h as a P controller needs to hold it.
    """
    car = car or VehicleConfig()
    hold = (car.drag * CRUISE**2 + car.rolling) / (car.max_acceleration * (1 - CRUISE / car.top_speed))
    target, gains = CRUISE / KMH + hold / gain, PIDGains(gain, 0.0, 0.0)
    ego, pid = EgoState(Pose(0.0, 0.0, 0.0), CRUISE + DISTURBANCE, throttle_response=hold), PIDState()
    speeds = []
    for _ in range(round(DURATION / DT)):
        speeds.append(ego.speed / KMH)
        pid, effort = pid_step(gains, pid, target - speeds[-1], DT)
        ego = advance(ego, Control(max(effort, 0.0), max(-effort, 0.0)), DT, car)
    return np.array(speeds)
