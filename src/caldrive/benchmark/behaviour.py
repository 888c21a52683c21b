"""What an agent saw and met in an episode, in figures: what its affordances were off by, also just before each
infraction, how long it was off its lane, and how many red lights it stopped for."""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from caldrive.datatypes import Affordances, Step
from caldrive.results import Infraction, InfractionKind

Column = NDArray[np.float64]  # (N,), a value a step
CONTINUOUS = ("vehicle_distance", "relative_angle", "center_distance")

DISCRETE = ("hazard_stop", "red_light")

NAMES = (*DISCRETE, "speed_sign", *CONTINUOUS)

OFF = 0.4  # share of the car beside its lane from which it counts as off it
BEFORE = 3.0  # s before an infraction in which the affordances are looked at
STANDING = 0.3  # m/s
SAME_LIGHT = 3.0  # s between two sights of a red light that are one; on to the next one a car drives for longer


class Behaviour:
    """Collects what figures are made of."""

    def __init__(self) -> None:
        self._rows: list[tuple[float, ...]] = []  # time, whether a light is red (or yellow), speed, off the lane
        self._errors: list[tuple[float, ...]] = []  # of NAMES, a row for each step

    def add(self, step: Step) -> None:
        """One more step."""
        truth = step.truth
        off = truth.opposite_share > OFF or truth.sidewalk_share > OFF
        self._rows.append((truth.time, truth.affordances.red_light, truth.ego.speed, off))
        seen = step.decision.affordances if step.decision is not None else None
        self._errors.append(_errors(seen, truth.affordances) if seen else (math.nan,) * len(NAMES))

    def figures(self, infractions: Sequence[Infraction]) -> dict[str, Any]:
        """All figures by name."""
        time, red, speed, off = np.array(self._rows, dtype=float).reshape(-1, 4).T
        errors = np.array(self._errors).reshape(-1, len(NAMES))
        before = [errors[(time > one.time - BEFORE) & (time <= one.time)] for one in infractions]
        run = [one.time for one in infractions if one.kind is InfractionKind.RED_LIGHT]
        found: dict[str, Any] = {"off_lane": float(off.mean()), "reds_obeyed": reds_obeyed(time, red, speed, run)}
        for prefix, part in (("error", errors), *((f"before/{k}", part) for k, part in enumerate(before))):
            means = zip(NAMES, _means(part), strict=True)
            found |= {f"{prefix}/{name}": value for name, value in means if not math.isnan(value)}
        return found


def reds_obeyed(time: Column, red: Column, speed: Column, run: Sequence[float]) -> int:
    """Lights that the car stood before while they were red, and did not run.

    red: whether a light that counts is red or yellow, in each step; run: when a red light was run, s, which ends the
    last approach to one. What turned green before the car stood, or was passed on yellow, does not count.
    """
    steps = np.flatnonzero(red > 0.5)
    if not len(steps):
        return 0
    approaches = np.split(steps, np.flatnonzero(np.diff(time[steps]) > SAME_LIGHT) + 1)
    begins = time[[approach[0] for approach in approaches]]
    lost = {int(np.searchsorted(begins, moment, side="right")) - 1 for moment in run}
    return sum(k not in lost and bool(speed[approach].min() < STANDING) for k, approach in enumerate(approaches))


def _means(errors: NDArray[np.float64]) -> list[float]:
    """The mean of each column (N, 6) over the steps in which it is known, NaN where it never is."""
    known = errors[~np.isnan(errors).all(axis=1)]
    if not len(known):
        return [math.nan] * len(NAMES)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # of a column without numbers
        return [float(value) for value in np.nanmean(known, axis=0)]


def _errors(seen: Affordances, true: Affordances) -> tuple[float, ...]:
    """1 for each discrete affordance that is wrong, and what the others are off by; NaN for those that are unknown."""
    wrong = [_wrong(getattr(seen, name), getattr(true, name)) for name in DISCRETE]
    off = [abs(getattr(seen, name) - getattr(true, name)) for name in CONTINUOUS]
    blind = all(map(math.isnan, (*wrong, *off)))  # then no sign is not seen: nothing is
    return (*wrong, math.nan if blind else float(seen.speed_sign != true.speed_sign), *off)


def _wrong(seen: float, true: float) -> float:
    return math.nan if math.isnan(seen) else float((seen > 0.5) != (true > 0.5))
