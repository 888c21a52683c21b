"""Failure causes, read from an episode's trace: what the car did wrong first, where, and what its agent saw there."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from caldrive.affordances import BY_NAME
from caldrive.benchmark.episode_metrics import STANDING_SPEED, stretches

Columns = Mapping[str, list[Any]]
OFF_CENTER = 1.3  # m from the centre line, where a wheel is over the marking of a lane of 4 m
OFF_CENTER_SECONDS = 3.0  # s of it after which the car has left its lane
LOOK_BACK = 2.0  # s in which what is seen leads to what happens
NEEDLESS_SECONDS = 10.0  # s of a stop for nothing by which a goal is missed
MAX_GAP = 3.0  # s between two steps of one stop, or of one time off the lane
GRID = 10.0  # m within which places are one
LEFT_LANE, NO_HAZARD, NO_RED_LIGHT = "left its lane", "stopped without a hazard", "stopped without a red light"
TOO_SLOW = "was too slow"
NOT_GIVEN = "the agent gives no affordances"
Place = tuple[str, int, int, str]  # an event, x and y in m, a command


@dataclass(frozen=True)
class FailureCause:
    """How a missed goal began."""

    event: str
    """What happened first."""
    time: float
    """When it happened, s."""
    x: float
    """Where it happened, m."""
    y: float
    """Where it happened, m."""
    command: str
    """The command at that time."""
    seen: str
    """What was seen and true just before, in words."""

    @property
    def place(self) -> Place:
        """The same for failures of one kind at one place."""
        return self.event, round(self.x / GRID) * int(GRID), round(self.y / GRID) * int(GRID), self.command

    def __str__(self) -> str:
        return f"{self.event} at ({self.x:.0f}, {self.y:.0f}), {self.command}: {self.seen}"


def failure_cause(trace: Columns) -> FailureCause:
    """How a missed goal began. trace: one value a step, by name (`Trace`)."""
    time, off_center = np.array(trace["time"]), np.array(trace["true_center_distance"], dtype=float)  # null is NaN
    first_steps = {
        LEFT_LANE: _first_lasting(time, np.abs(off_center) > OFF_CENTER, OFF_CENTER_SECONDS),
        NO_HAZARD: _first_lasting(time, _needless_stop(trace, "hazard_stop"), NEEDLESS_SECONDS),
        NO_RED_LIGHT: _first_lasting(time, _needless_stop(trace, "red_light"), NEEDLESS_SECONDS),
    }
    events = [(step, event) for event, step in first_steps.items() if step is not None]
    step, event = min(events, default=(len(time) - 1, TOO_SLOW))
    return FailureCause(
        event=event, time=trace["time"][step], x=trace["x"][step], y=trace["y"][step], command=trace["command"][step],
        seen=_seen(trace, step, event),
    )  # fmt: skip


def common_places(causes: Iterable[FailureCause]) -> list[tuple[Place, int]]:
    """What began how often at one place with one command, the most frequent first."""
    return Counter(cause.place for cause in causes).most_common()


def _first_lasting(time: NDArray[np.float64], true: NDArray[np.bool_], seconds: float) -> int | None:
    """The step in which something begins that is true for so long; short gaps do not end it. time, true: (N,)."""
    lasting = (run for run in stretches(time, true, MAX_GAP) if time[run[-1]] - time[run[0]] >= seconds)
    return next((int(run[0]) for run in lasting), None)


def _needless_stop(trace: Columns, name: str) -> NDArray[np.bool_]:
    """Whether the car stands, in each step (N,), for a hazard or a light that is not there."""
    stands = np.array(trace["speed"]) < STANDING_SPEED
    stopped_for_it = np.array(trace["state"]) == BY_NAME[name].title
    not_there = np.array(trace[f"true_{name}"], dtype=float) < 0.5
    return np.asarray(stands & stopped_for_it & not_there, dtype=np.bool_)


def _seen(trace: Columns, step: int, event: str) -> str:
    """What the affordances that matter were, and what was true."""
    if event == LEFT_LANE:
        errors = [_mean_error(trace, step, name) for name in ("relative_angle", "center_distance")]
        return ", ".join(filter(None, errors)) or NOT_GIVEN
    if event == TOO_SLOW:
        standing = float(np.mean(np.array(trace["speed"]) < STANDING_SPEED))
        return f"stood for {100 * standing:.0f} % of the time"
    spec = BY_NAME["hazard_stop" if event == NO_HAZARD else "red_light"]
    probability = trace[f"predicted_{spec.name}"][step]
    return NOT_GIVEN if probability is None else f"{spec.title} seen with {probability:.2f}"


def _mean_error(trace: Columns, step: int, name: str) -> str:
    """How far a continuous affordance was off in the seconds before a step, empty where the agent gave none."""
    time = np.array(trace["time"])
    before = (time >= time[step] - LOOK_BACK) & (time <= time[step])
    predicted, true = (np.array(trace[f"{kind}_{name}"], dtype=float)[before] for kind in ("predicted", "true"))
    errors = np.abs(predicted - true)
    if not np.isfinite(errors).any():
        return ""
    return f"{BY_NAME[name].title} off by {np.nanmean(errors):.2f} {BY_NAME[name].unit}"
