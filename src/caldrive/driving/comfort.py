"""How smoothly a car was driven (supplement 3.2), and how much of the time within nuPlan's bounds of comfort."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.signal import savgol_filter

Floats = NDArray[np.float64]
WINDOW = 7  # frames
TURNING = 0.05  # rad/s, the yaw rate from which a car turns
# nuPlan's bounds: longitudinal acceleration (low, high), lateral acceleration, longitudinal jerk, magnitude of the
# jerk, yaw rate, yaw acceleration.
NUPLAN = ((-4.05, 2.40), 4.89, 4.13, 8.37, 0.95, 1.93)


def comfort(times: ArrayLike, speeds: ArrayLike, headings: ArrayLike, centers: ArrayLike) -> dict[str, float]:
    """Figures of an episode by name, from its frames: those of `motion`, and the median |centre distance| in m."""
    time, center = np.asarray(times, dtype=float), np.abs(np.asarray(centers, dtype=float))
    dt = float(np.ptp(time)) / (len(time) - 1) if len(time) > 1 else 0.0
    figures = motion(np.asarray(speeds, dtype=float), np.unwrap(np.asarray(headings, dtype=float)), dt)
    return {"center_distance": float(np.median(center)) if len(center) else 0.0} | figures


def motion(speed: Floats, heading: Floats, dt: float) -> dict[str, float]:
    """Figures of comfort from speeds (N,) in m/s and continuous headings (N,) in rad, in SI units.

    jerk: RMS along the road; lateral_straight, lateral_turn: RMS of the lateral jerk on straights and in turns;
    turning: seconds in turns; comfortable: share of time within nuPlan's bounds. Derivatives are those of a parabola
    through WINDOW frames, as nuPlan takes them.
    """
    if len(speed) < WINDOW:
        return {"jerk": 0.0, "lateral_straight": 0.0, "lateral_turn": 0.0, "turning": 0.0, "comfortable": 1.0}
    speed, acceleration, jerk = (savgol_filter(speed, WINDOW, 2, deriv=k, delta=dt) for k in range(3))
    rate, yaw = (savgol_filter(heading, WINDOW, 2, deriv=k, delta=dt) for k in (1, 2))
    lateral = speed * rate
    sideways = acceleration * rate + speed * yaw
    turns = np.abs(rate) > TURNING
    (low, high), *limits = NUPLAN
    within = (acceleration >= low) & (acceleration <= high)
    for value, limit in zip((lateral, jerk, np.hypot(jerk, sideways), rate, yaw), limits, strict=True):
        within &= np.abs(value) <= limit
    return {
        "jerk": _rms(jerk), "lateral_straight": _rms(sideways[~turns]), "lateral_turn": _rms(sideways[turns]),
        "turning": float(turns.sum() * dt), "comfortable": float(within.mean()),
    }  # fmt: skip


def _rms(values: Floats) -> float:
    return float(np.sqrt(np.mean(values**2))) if len(values) else 0.0
