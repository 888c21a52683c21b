"""How smoothly a car was driven (supplement 3.2), and how much of the time within nuPlan's bounds of comfort.

The supplement prints jerks of 0.333, 0.052 and 0.065 m/s³ without a formula. A turn of 90° at 10 km/h cannot be driven
with less than 0.24 m/s³; the change of acceleration from frame to frame, at 10 Hz and not divided by 0.1 s, is of the
printed size. So both are given.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

Column = NDArray[np.float64]  # (N,), a value for each step
FRAME_METRICS = ("jerk_frame", "lateral_straight_frame", "lateral_turn_frame")
METRICS = ("center_distance", "jerk", "lateral_straight", "lateral_turn", *FRAME_METRICS, "turning", "comfortable")
WINDOW = 7  # steps
TURNING_RATE = 0.05  # rad/s, the yaw rate from which a car turns
# nuPlan's bounds in SI units.
ACCELERATION = (-4.05, 2.40)
LATERAL_ACCELERATION = 4.89
LONGITUDINAL_JERK = 4.13
JERK_MAGNITUDE = 8.37
YAW_RATE = 0.95
YAW_ACCELERATION = 1.93


def comfort(times: ArrayLike, speeds: ArrayLike, headings: ArrayLike, centers: ArrayLike) -> dict[str, float]:
    """Metrics of an episode by name: those of `motion`, and center_distance, the median |centre distance| in m.

    (N,) each: times in s, speeds in m/s, headings in rad, distances to the centre line in m.
    """
    time, center = np.asarray(times, dtype=float), np.abs(np.asarray(centers, dtype=float))
    dt = float(np.ptp(time)) / (len(time) - 1) if len(time) > 1 else 0.0
    metrics = motion(np.asarray(speeds, dtype=float), np.unwrap(np.asarray(headings, dtype=float)), dt)
    return {"center_distance": float(np.median(center)) if len(center) else 0.0} | metrics


def motion(speed: Column, heading: Column, dt: float) -> dict[str, float]:
    """Metrics of comfort from speeds (N,) in m/s and continuous headings (N,) in rad, dt s apart, in SI units.

    jerk: RMS along the road; lateral_straight, lateral_turn: RMS of the lateral jerk on straights and in turns;
    turning: seconds in turns; comfortable: share of time within nuPlan's bounds. Derivatives are those of a parabola
    through WINDOW steps, as nuPlan takes them. jerk_frame and its like: RMS change of acceleration a frame, m/s².
    """
    if len(speed) < WINDOW:
        return dict.fromkeys(METRICS[1:-1], 0.0) | {"comfortable": 1.0}
    from scipy.signal import savgol_filter  # takes a second to load: who records or learns does without

    changes = _changes(speed, heading, dt)
    speed, acceleration, jerk = (savgol_filter(speed, WINDOW, 2, deriv=k, delta=dt) for k in range(3))
    yaw_rate, yaw_acceleration = (savgol_filter(heading, WINDOW, 2, deriv=k, delta=dt) for k in (1, 2))
    lateral_acceleration = speed * yaw_rate
    lateral_jerk = acceleration * yaw_rate + speed * yaw_acceleration
    bounds = (
        (lateral_acceleration, LATERAL_ACCELERATION),
        (jerk, LONGITUDINAL_JERK),
        (np.hypot(jerk, lateral_jerk), JERK_MAGNITUDE),
        (yaw_rate, YAW_RATE),
        (yaw_acceleration, YAW_ACCELERATION),
    )
    comfortable = (acceleration >= ACCELERATION[0]) & (acceleration <= ACCELERATION[1])
    for values, bound in bounds:
        comfortable &= np.abs(values) <= bound
    turns = np.abs(yaw_rate) > TURNING_RATE
    return {
        "jerk": _rms(jerk),
        "lateral_straight": _rms(lateral_jerk[~turns]),
        "lateral_turn": _rms(lateral_jerk[turns]),
        "jerk_frame": _rms(changes[0]),
        "lateral_straight_frame": _rms(changes[1][~turns[1:-1]]),
        "lateral_turn_frame": _rms(changes[1][turns[1:-1]]),
        "turning": float(turns.sum() * dt),
        "comfortable": float(comfortable.mean()),
    }


def _changes(speed: Column, heading: Column, dt: float) -> tuple[Column, Column]:
    """By how much the accelerations along the road and across it change (N - 2,) from one frame to the next, m/s²."""
    along, across = np.diff(speed) / dt, (speed[1:] + speed[:-1]) / 2 * np.diff(heading) / dt
    return np.diff(along), np.diff(across)


def _rms(values: Column) -> float:
    return float(np.sqrt(np.mean(values**2))) if len(values) else 0.0
