"""What cars do that one does not expect: the one ahead of the ego brakes hard, or stands broken down for a while."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from caldrive.datatypes import VehicleState
from caldrive.geometry import to_local

RATE = 1 / 40  # 1/s, while somebody drives ahead
NEAREST, FARTHEST = 5.0, 30.0  # m between the bumpers
BESIDE = 1.2  # m from the ego's middle line
SAME_WAY = 0.95  # cosine of the angle to the ego
SLOWEST = 2.5  # m/s of a car that something happens to
BREAKDOWNS = 0.3  # share of the incidents
HARD_BRAKE, ROLL_OUT = 7.0, 2.5  # m/s² of who brakes hard, and of who breaks down
STOP, BREAKDOWN = (1.5, 4.0), (10.0, 18.0)  # s that they stand, from and to


@dataclass(frozen=True)
class Incident:
    """A car that stops for no reason that others see."""

    name: str
    brake: float
    """m/s²."""
    since: float
    """s."""
    speed: float
    """m/s that it had."""
    stands: float
    """s."""

    def allowed(self, time: float) -> float:
        """m/s that it drives at most at a time."""
        return max(0.0, self.speed - self.brake * (time - self.since))

    def is_over(self, time: float) -> bool:
        """Whether it drives on."""
        return time > self.since + self.speed / self.brake + self.stands


class Incidents:
    """Those of an episode. current: what happens now, None while nothing does."""

    def __init__(self, rng: np.random.Generator) -> None:
        self.rng = rng
        self.current: Incident | None = None

    def step(self, time: float, dt: float, ego: VehicleState, cars: Sequence[VehicleState]) -> Incident | None:
        """What happens from now on; each incident happens to the car next ahead of the ego."""
        if self.current is not None:
            if self.current.is_over(time):
                self.current = None
            return self.current
        if self.rng.random() < RATE * dt and (car := _next_ahead(ego, cars)) is not None:
            breaks_down = self.rng.random() < BREAKDOWNS
            stands = self.rng.uniform(*(BREAKDOWN if breaks_down else STOP))
            brake = ROLL_OUT if breaks_down else HARD_BRAKE
            self.current = Incident(car.id, brake=brake, since=time, speed=car.speed, stands=float(stands))
        return self.current


def _next_ahead(ego: VehicleState, cars: Sequence[VehicleState]) -> VehicleState | None:
    """The car that drives ahead of the ego in its lane, if one does."""
    gaps = []
    for car in cars:
        ahead, left = to_local(ego.pose, np.array((car.pose.x, car.pose.y))).tolist()
        gap = ahead - (ego.length + car.length) / 2
        is_ahead = NEAREST < gap < FARTHEST and abs(left) < BESIDE
        if is_ahead and car.speed > SLOWEST and math.cos(car.pose.heading - ego.pose.heading) > SAME_WAY:
            gaps.append((gap, car.id, car))
    return min(gaps)[2] if gaps else None
