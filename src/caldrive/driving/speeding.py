"""Speeding: how much faster than the law allows, where a lower limit leaves time to brake."""

from __future__ import annotations

import math

from caldrive.datatypes import KMH, Truth

TOLERANCE = 3.0  # km/h, as with a radar on the road
BRAKING = 2.0  # m/s² by which a driver has to slow down from a sign on: it is seen from 14 m on at most


def allowed_speed(before: float, limit: float, dt: float) -> float:
    """The speed (m/s) allowed dt s after another one was, under a limit in m/s: a higher one counts at once."""
    return max(limit, before - BRAKING * dt)


class SpeedWatch:
    """Watches an episode's speed. share: of the time that was too fast, in [0, 1]; worst: largest excess, km/h."""

    def __init__(self) -> None:
        self.worst = 0.0
        self._allowed = math.inf
        self._time: float | None = None
        self._steps = self._fast = 0

    @property
    def share(self) -> float:
        """Of the time in [0, 1] in which it was faster than allowed by more than TOLERANCE."""
        return self._fast / self._steps if self._steps else 0.0

    def is_too_fast(self, truth: Truth) -> bool:
        """Whether the ego is, one step later."""
        limit = truth.speed_limit * KMH
        dt = 0.0 if self._time is None else truth.time - self._time
        self._allowed = limit if self._time is None else allowed_speed(self._allowed, limit, dt)
        self._time = truth.time
        excess = (truth.ego.speed - self._allowed) / KMH
        self._steps += 1
        self._fast += excess > TOLERANCE
        self.worst = max(self.worst, excess)
        return excess > TOLERANCE
