"""Metrics of one episode: how far its affordances were off, also just before each infraction, how long the car was off
its lane, and how many red lights it obeyed."""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from caldrive.affordances import BINARY, CONTINUOUS, SPECS, AffordanceSpec
from caldrive.datatypes import Affordances, Step
from caldrive.results import Infraction, InfractionKind

Column = NDArray[np.float64]  # (N,), a value for each step
OFF_LANE_SHARE = 0.4  # of the car's area beside its lane from which it counts as off the lane
SECONDS_BEFORE = 3.0  # s before an infraction in which the affordances are looked at
STANDING_SPEED = 0.3  # m/s, below which the car stands
# s between two steps with a red light ahead that belong to one approach; a car needs longer to the next light
SAME_LIGHT_GAP = 3.0


class EpisodeMetrics:
    """Collects an episode's steps and computes its metrics."""

    def __init__(self) -> None:
        self._rows: list[tuple[float, ...]] = []  # time, whether a light is red (or yellow), speed, off the lane
        self._errors: list[tuple[float, ...]] = []  # one for each of SPECS

    def add(self, step: Step) -> None:
        """One more step."""
        truth = step.truth
        off_lane = truth.opposite_share > OFF_LANE_SHARE or truth.sidewalk_share > OFF_LANE_SHARE
        self._rows.append((truth.time, truth.affordances.red_light, truth.ego.speed, off_lane))
        predicted = step.decision.affordances if step.decision is not None else None
        errors = affordance_errors(predicted, truth.affordances) if predicted else (math.nan,) * len(SPECS)
        self._errors.append(errors)

    def compute(self, infractions: Sequence[Infraction]) -> dict[str, Any]:
        """All metrics by name.

        off_lane: share of the time in [0, 1]. reds_obeyed: how many red lights. error/NAME: of an affordance over the
        episode, before/K/NAME: in the seconds before infraction K; the share of wrong steps for a discrete one, the
        mean absolute error in SI units for a continuous one. An affordance that the agent never gives has none.
        """
        time, red, speed, off_lane = np.array(self._rows, dtype=float).reshape(-1, 4).T
        errors = np.array(self._errors).reshape(-1, len(SPECS))
        runs = [infraction.time for infraction in infractions if infraction.kind is InfractionKind.RED_LIGHT]
        metrics: dict[str, Any] = {
            "off_lane": float(off_lane.mean()), "reds_obeyed": red_lights_obeyed(time, red, speed, runs)
        }  # fmt: skip
        metrics |= _named_means("error", errors)
        for k, infraction in enumerate(infractions):
            before = (time > infraction.time - SECONDS_BEFORE) & (time <= infraction.time)
            metrics |= _named_means(f"before/{k}", errors[before])
        return metrics


def stretches(time: Column, true: NDArray[np.bool_], gap: float) -> list[NDArray[np.intp]]:
    """The numbers of the steps in which something is true, split where it is not for more than gap s. time, true: (N,),
    time in s."""
    steps = np.flatnonzero(true)
    return np.split(steps, np.flatnonzero(np.diff(time[steps]) > gap) + 1) if len(steps) else []


def red_lights_obeyed(time: Column, red: Column, speed: Column, run_at: Sequence[float]) -> int:
    """Lights that the car stood before while they were red, and did not run.

    time (N,) in s; red (N,): 1 where a light that counts is red or yellow; speed (N,) in m/s; run_at: when a red light
    was run (s), which is the end of the last approach to one. What turned green before the car stood, or was passed on
    yellow, does not count.
    """
    approaches = stretches(time, red > 0.5, SAME_LIGHT_GAP)
    run = {
        k
        for k, approach in enumerate(approaches)
        if any(time[approach[0]] <= seconds <= time[approach[-1]] + SAME_LIGHT_GAP for seconds in run_at)
    }
    return sum(k not in run and bool(speed[approach].min() < STANDING_SPEED) for k, approach in enumerate(approaches))


def affordance_errors(predicted: Affordances, true: Affordances) -> tuple[float, ...]:
    """One for each of SPECS: 1 where a discrete affordance is wrong, the absolute error of a continuous one.

    NaN where an affordance is unknown. Where all numbers are unknown, the agent was blind, and no sign is no answer.
    """
    blind = all(math.isnan(getattr(predicted, spec.name)) for spec in (*BINARY, *CONTINUOUS))
    return tuple(
        math.nan if blind else _error(spec, getattr(predicted, spec.name), getattr(true, spec.name)) for spec in SPECS
    )


def _error(spec: AffordanceSpec, predicted: Any, true: Any) -> float:
    if not spec.discrete:
        return float(abs(predicted - true))
    if not spec.binary:
        return float(predicted != true)
    return math.nan if math.isnan(predicted) else float((predicted > 0.5) != (true > 0.5))


def _named_means(prefix: str, errors: NDArray[np.float64]) -> dict[str, float]:
    """The mean of each column (N, 6) over the steps in which it is known, by name, without those that never are."""
    known = errors[~np.isnan(errors).all(axis=1)]
    if not len(known):
        return {}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # of a column without numbers
        means = zip(SPECS, np.nanmean(known, axis=0), strict=True)
    return {f"{prefix}/{spec.name}": float(mean) for spec, mean in means if not math.isnan(mean)}
