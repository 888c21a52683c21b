"""How an episode was driven, step by step, in figures: what the affordances were off by, how smooth it was, which red
lights were met (supplement 3.2)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.signal import savgol_filter

from caldrive.datatypes import Step
from caldrive.results import Infraction

Floats = NDArray[np.float64]
CONTINUOUS = ("vehicle_distance", "relative_angle", "center_distance")
DISCRETE = ("hazard_stop", "red_light")
OFF = 0.4  # share of the car beside its lane from which it counts as off it
BEFORE = 3.0  # s before an infraction in which the affordances are looked at
WINDOW = 7  # frames
TURNING = 0.05  # rad/s, the yaw rate from which a car turns
# nuPlan's bounds: longitudinal acceleration (low, high), lateral acceleration, longitudinal jerk, magnitude of the
# jerk, yaw rate, yaw acceleration.
NUPLAN = ((-4.05, 2.40), 4.89, 4.13, 8.37, 0.95, 1.93)


class Behaviour:
    """Collects what figures are made of."""

    def __init__(self, dt: float) -> None:
        self.dt = dt
        self._rows: list[tuple[float, ...]] = []
        self._errors: list[tuple[float, ...]] = []

    def add(self, step: Step) -> None:
        """One more step."""
        ego, true = step.truth.ego, step.truth.affordances
        off = float(step.truth.opposite_share > OFF or step.truth.sidewalk_share > OFF)
        moment = (step.truth.time, ego.speed, ego.pose.heading, true.center_distance, float(true.red_light), off)
        self._rows.append(moment)
        if step.decision is not None:
            seen = step.decision.affordances
            wrong = [float((getattr(seen, name) > 0.5) != (getattr(true, name) > 0.5)) for name in DISCRETE]
            wrong.append(float(seen.speed_sign != true.speed_sign))
            self._errors.append((*wrong, *(abs(getattr(seen, name) - getattr(true, name)) for name in CONTINUOUS)))

    def figures(self, infractions: Sequence[Infraction]) -> dict[str, Any]:
        """All figures by name."""
        time, speed, heading, center, red, off = np.array(self._rows, dtype=float).reshape(-1, 6).T
        found: dict[str, Any] = {"seconds": len(time) * self.dt}
        found |= motion(speed, np.unwrap(heading), self.dt)
        found["center_distance"] = float(np.median(np.abs(center))) if len(center) else 0.0
        found["off_lane"] = float(off.mean()) if len(off) else 0.0
        found["reds_met"] = int((np.diff(red, prepend=0.0) > 0).sum())
        errors = np.array(self._errors, dtype=float).reshape(-1, 6)
        names = (*DISCRETE, "speed_sign", *CONTINUOUS)
        if len(errors):
            found |= {f"error/{name}": float(np.nanmean(errors[:, k])) for k, name in enumerate(names)}
        before = [
            errors[(time[: len(errors)] > one.time - BEFORE) & (time[: len(errors)] <= one.time)] for one in infractions
        ]
        for k, part in enumerate(before):
            if len(part):
                found |= {f"before/{k}/{name}": float(np.nanmean(part[:, j])) for j, name in enumerate(names)}
        return found


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
