"""What happened in an episode, as JSON: the result, and one value a step in columns."""

from __future__ import annotations

import json
import math
from dataclasses import asdict, fields
from typing import Any, Literal, TypedDict

from caldrive.config import KMH
from caldrive.datatypes import Affordances, Step
from caldrive.results import EpisodeResult, Infraction, Outcome
from caldrive.scenarios import scenario_from_values, scenario_values
from caldrive.typed import as_type

TRACE_VERSION = 1
DIGITS = 4
COLUMNS = (  # what a benchmark's trace has at least
    "time", "x", "y", "speed", "command", "route_done", "road_limit", "state", "speed_limit",
    *(f"{kind}_{one.name}" for kind in ("predicted", "true") for one in fields(Affordances)),
)  # fmt: skip


def plain(value: Any) -> Any:
    """The value as JSON knows it: rounded, and null where it is no number."""
    if isinstance(value, float):
        return round(value, DIGITS) if math.isfinite(value) else None
    return value


def _row(step: Step) -> dict[str, Any]:
    ego, seen, decision = step.truth.ego, step.observation, step.decision
    row: dict[str, Any] = {"time": seen.time, **asdict(ego.pose), "speed": seen.speed, "command": seen.command.value}
    row |= {"route_done": step.truth.route_done, "road_limit": step.truth.speed_limit}
    row |= asdict(step.control)
    if decision is not None:
        row |= {"state": decision.state.value, "speed_limit": decision.speed_limit, "note": decision.note or None}
        row |= {"target_speed": decision.target_speed}
    for name, value in asdict(step.truth.affordances).items():
        row[f"predicted_{name}"] = getattr(decision.affordances, name) if decision is not None else None
        row[f"true_{name}"] = value
    return row


class Trace:
    """Collects an episode's steps. Units as in `datatypes`: s, m, rad, m/s; limits and targets in km/h."""

    def __init__(self) -> None:
        self._rows: list[dict[str, Any]] = []

    def add(self, step: Step) -> None:
        self._rows.append({name: plain(value) for name, value in _row(step).items()})

    def columns(self) -> dict[str, list[Any]]:
        """One list for each name, one entry for each step."""
        names = self._rows[0] if self._rows else ()
        return {name: [row.get(name) for row in self._rows] for name in names}


def mean_speed(result: EpisodeResult) -> float:
    """km/h over the whole episode, stops included."""
    return result.distance / result.duration / KMH if result.duration > 0 else 0.0


class _Result(TypedDict):
    """What `result_values` writes and is needed to make a result again."""

    scenario: dict[str, Any]
    outcome: Literal["success", "timeout", "failed", "aborted"]
    duration: float
    distance: float
    route_done: float
    route_length: float | None
    infractions: tuple[Infraction, ...]
    comfort: dict[str, float]


def result_from_values(values: Any) -> EpisodeResult:
    """The inverse of `result_values`, up to its rounding. Raises ValueError for what is no result."""
    found = as_type(values, _Result)
    length = math.inf if found["route_length"] is None else found["route_length"]
    return EpisodeResult(
        scenario_from_values(found["scenario"]), Outcome[found["outcome"].upper()], found["duration"],
        found["distance"], found["route_done"], length, found["infractions"], found["comfort"],
    )  # fmt: skip


def result_values(result: EpisodeResult) -> dict[str, Any]:
    """An EpisodeResult in JSON's types; mean_speed in km/h."""
    broken = [asdict(one) | {"kind": one.kind.value} for one in result.infractions]
    return {
        "scenario": scenario_values(result.scenario),
        "outcome": result.outcome.name.lower(),
        "message": result.outcome.value,
        "infractions": [{name: plain(value) for name, value in one.items()} for one in broken],
        "comfort": {name: plain(value) for name, value in result.comfort.items()},
        "mean_speed": plain(mean_speed(result)),
        **{name: plain(getattr(result, name)) for name in ("duration", "distance", "route_done", "route_length")},
    }


def json_line(values: dict[str, Any]) -> bytes:
    """Values in JSON's types as one line."""
    return json.dumps(values, separators=(",", ":"), allow_nan=False).encode() + b"\n"


def episode_json(result: EpisodeResult, trace: Trace) -> bytes:
    """An episode's file."""
    return json_line({"version": TRACE_VERSION, "result": result_values(result), "trace": trace.columns()})
