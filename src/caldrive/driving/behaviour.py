"""What an agent saw and met in an episode, in figures: what its affordances were off by, also just before each
infraction, how long it was off its lane, and how many red lights it met."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from caldrive.datatypes import Affordances, Step
from caldrive.results import Infraction

CONTINUOUS = ("vehicle_distance", "relative_angle", "center_distance")
DISCRETE = ("hazard_stop", "red_light")
NAMES = (*DISCRETE, "speed_sign", *CONTINUOUS)
OFF = 0.4  # share of the car beside its lane from which it counts as off it
BEFORE = 3.0  # s before an infraction in which the affordances are looked at


class Behaviour:
    """Collects what figures are made of."""

    def __init__(self) -> None:
        self._rows: list[tuple[float, ...]] = []  # time, red light, off the lane
        self._errors: list[tuple[float, ...]] = []  # of NAMES, a row for each step

    def add(self, step: Step) -> None:
        """One more step."""
        truth = step.truth
        off = truth.opposite_share > OFF or truth.sidewalk_share > OFF
        self._rows.append((truth.time, truth.affordances.red_light, off))
        seen = step.decision.affordances if step.decision is not None else None
        self._errors.append(_errors(seen, truth.affordances) if seen else (math.nan,) * len(NAMES))

    def figures(self, infractions: Sequence[Infraction]) -> dict[str, Any]:
        """All figures by name."""
        time, red, off = np.array(self._rows, dtype=float).reshape(-1, 3).T
        errors = np.array(self._errors).reshape(-1, len(NAMES))
        before = [errors[(time > one.time - BEFORE) & (time <= one.time)] for one in infractions]
        found: dict[str, Any] = {"off_lane": float(off.mean()), "reds_met": int((np.diff(red, prepend=0.0) > 0).sum())}
        for prefix, part in (("error", errors), *((f"before/{k}", part) for k, part in enumerate(before))):
            known = part[~np.isnan(part).all(axis=1)]  # an agent may decide without affordances
            if len(known):
                found |= {
                    f"{prefix}/{name}": float(v) for name, v in zip(NAMES, np.nanmean(known, axis=0), strict=True)
                }
        return found


def _errors(seen: Affordances, true: Affordances) -> tuple[float, ...]:
    """1 for each discrete affordance that is wrong, and what the others are off by."""
    wrong = [float((getattr(seen, name) > 0.5) != (getattr(true, name) > 0.5)) for name in DISCRETE]
    off = [abs(getattr(seen, name) - getattr(true, name)) for name in CONTINUOUS]
    return (*wrong, float(seen.speed_sign != true.speed_sign), *off)
