"""How a missed goal began, read from the episode's trace: what the car did wrong first, where, and what it saw."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from caldrive.benchmark.behaviour import STANDING

Columns = Mapping[str, list[Any]]
OFF_LANE, ASTRAY = 1.3, 3.0  # m from the centre line, where a wheel is over the marking of a lane of 4 m, and s of it
BEFORE = 2.0  # s in which what is seen leads to what happens
NEEDLESS, FLICKER = 10.0, 3.0  # s of a stop for nothing that make a goal be missed, and of a pause within either
NOT_TOLD = "the agent does not say what it saw"
GRID = 10.0  # m within which places are one


@dataclass(frozen=True)
class Cause:
    """What happened first, at x, y in m, to which command, and what was seen and true just before."""

    what: str
    x: float
    y: float
    command: str
    seen: str

    @property
    def place(self) -> tuple[str, int, int, str]:
        """The same for failures of one kind at one place."""
        return self.what, round(self.x / GRID) * int(GRID), round(self.y / GRID) * int(GRID), self.command

    def __str__(self) -> str:
        return f"{self.what} at ({self.x:.0f}, {self.y:.0f}), {self.command}: {self.seen}"


def cause(trace: Columns) -> Cause:
    """How a missed goal began. trace: one value a step, by name (`Trace`)."""
    time = np.array(trace["time"])
    starts = {
        "left its lane": _lasting(time, np.abs(trace["true_center_distance"]) > OFF_LANE, ASTRAY),
        "stood before no hazard": _lasting(time, _needless(trace, "hazard_stop"), NEEDLESS),
        "stood at no red light": _lasting(time, _needless(trace, "red_light"), NEEDLESS),
    }
    found = [(at, what) for what, at in starts.items() if at is not None]
    at, what = min(found, default=(len(time) - 1, "was too slow"))
    return Cause(what, trace["x"][at], trace["y"][at], trace["command"][at], _seen(trace, at, what))


def _lasting(time: NDArray[np.float64], true: NDArray[np.bool_], least: float) -> int | None:
    """Where something begins that is true for so many s; moments in which it is not do not end it."""
    steps = np.flatnonzero(true)
    for run in np.split(steps, np.flatnonzero(np.diff(time[steps]) > FLICKER) + 1):
        if len(run) and time[run[-1]] - time[run[0]] >= least:
            return int(run[0])
    return None


def _needless(trace: Columns, name: str) -> NDArray[np.bool_]:
    """Whether the car stands, in each step, for what is not there."""
    stands = np.array(trace["speed"]) < STANDING
    says_so = np.array(trace["state"]) == name.replace("_", " ")
    return np.asarray(stands & says_so & (np.array(trace[f"true_{name}"], dtype=float) < 0.5), dtype=np.bool_)


def _seen(trace: Columns, at: int, what: str) -> str:
    """What the affordances that matter were, and what was true."""
    time = np.array(trace["time"])
    if what == "left its lane":
        before = (time >= time[at] - BEFORE) & (time <= time[at])
        parts = []
        for name, label, unit in (
            ("relative_angle", "relative angle", "rad"),
            ("center_distance", "centre distance", "m"),
        ):
            seen, true = (np.array(trace[f"{kind}_{name}"], dtype=float)[before] for kind in ("predicted", "true"))
            wrong = np.abs(seen - true)
            if np.isfinite(wrong).any():  # an agent may give no affordances
                parts.append(f"{label} off by {np.nanmean(wrong):.2f} {unit}")
        return ", ".join(parts) or NOT_TOLD
    stood = float(np.mean(np.array(trace["speed"]) < STANDING))
    if what == "was too slow":
        return f"stood for {100 * stood:.0f} % of the time"
    name = "hazard_stop" if "hazard" in what else "red_light"
    seen = trace[f"predicted_{name}"][at]
    return NOT_TOLD if seen is None else f"{name.replace('_', ' ')} seen with {seen:.2f}"


def common_places(causes: Iterable[Cause]) -> list[tuple[tuple[str, int, int, str], int]]:
    """What began how often at one place with one command, the most frequent first."""
    return Counter(one.place for one in causes).most_common()
