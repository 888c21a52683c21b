"""How a missed goal began, read from the episode's trace: what the car did wrong first, where, and what it saw."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

Columns = Mapping[str, list[Any]]

OFF_LANE = 1.3  # m from the centre line: a wheel is over the marking of a lane of 4 m
BEFORE = 2.0  # s in which what is seen leads to what happens
STANDING = 0.3  # m/s
NEEDLESS, FLICKER = 10.0, 3.0  # s of a stop for nothing that make a goal be missed, and of a pause within it
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
    off = np.flatnonzero(np.abs(trace["true_center_distance"]) > OFF_LANE)
    found = [(int(off[0]), "left its lane")] if len(off) else []
    for name, what in (("hazard_stop", "stood before no hazard"), ("red_light", "stood at no red light")):
        at = _needless(trace, name)
        found += [(at, what)] if at is not None else []
    at, what = min(found, default=(len(trace["time"]) - 1, "was too slow"))
    return Cause(what, trace["x"][at], trace["y"][at], trace["command"][at], _seen(trace, at, what))


def _needless(trace: Columns, name: str) -> int | None:
    """Where a stop for nothing begins that lasts too long; moments in which it is not seen do not end it."""
    time = np.array(trace["time"])
    stands = np.flatnonzero(
        (np.array(trace["speed"]) < STANDING)
        & (np.array(trace["state"]) == name.replace("_", " "))
        & (np.array(trace[f"true_{name}"], dtype=float) < 0.5)
    )
    for stop in np.split(stands, np.flatnonzero(np.diff(time[stands]) > FLICKER) + 1):
        if len(stop) and time[stop[-1]] - time[stop[0]] >= NEEDLESS:
            return int(stop[0])
    return None


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
            parts.append(f"{label} off by {np.abs(seen - true).mean():.2f} {unit}")
        return ", ".join(parts)
    stood = float(np.mean(np.array(trace["speed"]) < STANDING))
    if what == "was too slow":
        return f"stood for {100 * stood:.0f} % of the time"
    name = "hazard_stop" if "hazard" in what else "red_light"
    return f"{name.replace('_', ' ')} seen with {trace[f'predicted_{name}'][at]:.2f}"


def common_places(causes: Iterable[Cause]) -> list[tuple[tuple[str, int, int, str], int]]:
    """What began how often at one place with one command, the most frequent first."""
    return Counter(one.place for one in causes).most_common()
