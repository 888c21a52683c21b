"""What happened in an episode, as JSON: the result, and one value a step in columns."""

from __future__ import annotations

from dataclasses import asdict, fields
from typing import Any

import numpy as np

from caldrive.datatypes import Affordances, Step
from caldrive.files import json_line
from caldrive.results import EpisodeResult, plain, result_values

TRACE_VERSION = 1
COLUMNS = (  # what a benchmark's trace has at least
    "time", "x", "y", "speed", "command", "route_done", "road_limit", "state", "speed_limit",
    *(f"{kind}_{one.name}" for kind in ("predicted", "true") for one in fields(Affordances)),
)  # fmt: skip


def _row(step: Step) -> dict[str, Any]:
    ego, seen, decision = step.truth.ego, step.observation, step.decision
    row: dict[str, Any] = {"time": seen.time, **asdict(ego.pose), "speed": seen.speed, "command": seen.command.value}
    row |= {"route_done": step.truth.route_done, "road_limit": step.truth.speed_limit}
    row |= asdict(step.control)
    row |= {"state": None, "speed_limit": None, "note": None, "target_speed": None}
    if decision is not None:
        state = decision.state if decision.state is None else str(decision.state)
        row |= {"state": state, "speed_limit": decision.speed_limit, "note": decision.note or None}
        row |= {"target_speed": decision.target_speed}
    told = decision.affordances if decision is not None else None
    for name, value in asdict(step.truth.affordances).items():
        row[f"predicted_{name}"] = getattr(told, name) if told is not None else None
        row[f"true_{name}"] = value
    return row


def _as_python(value: Any) -> Any:
    """NumPy's numbers, which an agent of one's own may give, as Python's."""
    return value.item() if isinstance(value, np.generic) else value


class Trace:
    """Collects an episode's steps. Units as in `datatypes`: s, m, rad, m/s; limits and targets in km/h."""

    def __init__(self) -> None:
        self._rows: list[dict[str, Any]] = []

    def add(self, step: Step) -> None:
        """One more step."""
        self._rows.append({name: plain(_as_python(value)) for name, value in _row(step).items()})

    def columns(self) -> dict[str, list[Any]]:
        """One list for each name, one entry for each step."""
        names = self._rows[0] if self._rows else ()
        return {name: [row.get(name) for row in self._rows] for name in names}


def episode_json(result: EpisodeResult, trace: Trace) -> bytes:
    """An episode's file."""
    return json_line({"version": TRACE_VERSION, "result": result_values(result), "trace": trace.columns()})
