"""What happened in an episode, as JSON: the result, and one value a step in columns."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import numpy as np

from caldrive.affordances import SPECS
from caldrive.datatypes import Decision, Step
from caldrive.files import json_line
from caldrive.results import EpisodeResult, plain, result_values

TRACE_VERSION = 1
COLUMNS = (  # what a benchmark's trace has at least
    "time", "x", "y", "speed", "command", "route_done", "road_limit", "state", "speed_limit",
    *(f"{kind}_{spec.name}" for kind in ("predicted", "true") for spec in SPECS),
)  # fmt: skip


class Trace:
    """Collects an episode's steps. Units as in `datatypes`: s, m, rad, m/s; limits and targets in km/h."""

    def __init__(self) -> None:
        self._rows: list[dict[str, Any]] = []

    def add(self, step: Step) -> None:
        """One more step."""
        self._rows.append({name: plain(_as_python(value)) for name, value in _row(step).items()})

    def columns(self) -> dict[str, list[Any]]:
        """One list for each name, one entry for each step; None for what the agent does not give."""
        names = self._rows[0] if self._rows else ()
        return {name: [row.get(name) for row in self._rows] for name in names}


def episode_json(result: EpisodeResult, trace: Trace) -> bytes:
    """An episode's file."""
    return json_line({"version": TRACE_VERSION, "result": result_values(result), "trace": trace.columns()})


def _row(step: Step) -> dict[str, Any]:
    """A step's values by the names of their columns."""
    ego, observation = step.truth.ego, step.observation
    decision = step.decision or Decision(step.control)
    row: dict[str, Any] = {
        "time": observation.time, **asdict(ego.pose), "speed": observation.speed, "command": observation.command.value,
        "route_done": step.truth.route_done, "road_limit": step.truth.speed_limit, **asdict(step.control),
        "state": None if decision.state is None else str(decision.state), "speed_limit": decision.speed_limit,
        "note": decision.note or None, "target_speed": decision.target_speed,
    }  # fmt: skip
    for name, value in asdict(step.truth.affordances).items():
        row[f"predicted_{name}"] = getattr(decision.affordances, name, None)
        row[f"true_{name}"] = value
    return row


def _as_python(value: Any) -> Any:
    """NumPy's numbers, which an agent of one's own may give, as Python's."""
    return value.item() if isinstance(value, np.generic) else value
