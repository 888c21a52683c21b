"""How an episode went: its outcome, its infractions and its figures."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, field
from enum import Enum
from typing import Any, Literal, TypedDict

from caldrive.datatypes import KMH
from caldrive.files import as_type
from caldrive.scenarios import Scenario, scenario_from_values, scenario_values


class Outcome(Enum):
    """How an episode ended, as a message."""

    SUCCESS = "reached the goal in time"
    TIMEOUT = "ran out of time"
    FAILED = "broke a rule that ends the episode"
    ABORTED = "was stopped before its end"


class InfractionKind(Enum):
    """The paper's six kinds of infraction (section 3)."""

    OPPOSITE_LANE = "opposite lane"
    SIDEWALK = "sidewalk"
    RED_LIGHT = "red light"
    COLLISION_OBJECT = "collision with object"
    COLLISION_CAR = "collision with car"
    COLLISION_PERSON = "collision with person"


@dataclass(frozen=True)
class Infraction:
    kind: InfractionKind
    time: float
    x: float
    y: float
    at_fault: bool = True


@dataclass(frozen=True)
class EpisodeResult:
    """duration in s, distance in m, route_done and route_length in m, comfort: figures by name."""

    scenario: Scenario
    outcome: Outcome
    duration: float
    distance: float
    route_done: float
    route_length: float
    infractions: tuple[Infraction, ...] = ()
    comfort: dict[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name in ("duration", "distance"):
            if not 0 <= getattr(self, name) < math.inf:
                raise ValueError(f"{name} is {getattr(self, name)}, but must be 0 or more: look at how it was measured")
        if not (self.route_length > 0 and math.isfinite(self.route_done)):
            raise ValueError(f"{self.route_done} m of {self.route_length} m are no part of a route: look at its length")


DIGITS = 4


def plain(value: Any) -> Any:
    """The value as JSON knows it: rounded, and null where it is no number."""
    if isinstance(value, float):
        return round(value, DIGITS) if math.isfinite(value) else None
    return value


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
