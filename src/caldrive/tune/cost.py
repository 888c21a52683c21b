"""What a drive costs: time, jerk, distance to the centre line and infractions in one number.

Each part is in units of a published figure, so that weights of 1 count them alike.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from statistics import fmean

import numpy as np

from caldrive.driving.comfort import JERK_MAGNITUDE
from caldrive.results import Outcome
from caldrive.tune.config import CostWeights
from caldrive.tune.signals import Drive

CENTER_DISTANCE = 0.334  # m, the paper's median for CAL (supplement 3.2)


@dataclass(frozen=True)
class Cost:
    """The parts of a drive's cost, not yet weighted, or their means over several drives."""

    time: float
    """The share of the time limit that it took."""
    jerk: float
    """RMS of the jerk's magnitude, in units of nuPlan's bound of comfort."""
    center: float
    """Mean distance to the centre line, in units of the paper's median."""
    infractions: float
    """How many at fault, and one more where the goal was not reached."""

    def total(self, weights: CostWeights) -> float:
        """The weighted sum."""
        return (
            weights.time * self.time
            + weights.jerk * self.jerk
            + weights.center * self.center
            + weights.infraction * self.infractions
        )


def cost(drive: Drive) -> Cost:
    """Of one drive."""
    seen, result = drive.signals, drive.result
    return Cost(
        time=result.duration / result.scenario.time_limit,
        jerk=float(np.sqrt(np.mean(seen.jerk**2 + seen.lateral_jerk**2))) / JERK_MAGNITUDE,
        center=float(np.mean(np.abs(seen.center_distance))) / CENTER_DISTANCE,
        infractions=sum(one.at_fault for one in result.infractions) + (result.outcome is not Outcome.SUCCESS),
    )


def mean_cost(costs: Sequence[Cost]) -> Cost:
    """The means over one or more drives."""
    return Cost(*(fmean(getattr(one, name) for one in costs) for name in ("time", "jerk", "center", "infractions")))
