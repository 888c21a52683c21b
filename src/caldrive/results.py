"""How an episode went: its outcome, its infractions and its figures, in Python and in JSON."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, field
from enum import Enum
from typing import Any, Literal, TypedDict

from caldrive.datatypes import KMH
from caldrive.files import as_type
from caldrive.scenarios import Scenario, scenario_from_values, scenario_values

DIGITS = 4  # after the point, of numbers in files


class Outcome(Enum):
    """How an episode ended, as a message."""

    SUCCESS = "reached the goal in time"
    TIMEOUT = "ran out of time"
    FAILED = "broke a rule that ends the episode"
    ABORTED = "was stopped before its end"


WITHOUT_END = (Outcome.TIMEOUT, Outcome.ABORTED)  # neither the goal nor a broken rule ended the episode


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
    """A rule that was broken: when (s), where (x, y of the ego in m), and whether it was the ego's own fault."""

    kind: InfractionKind
    time: float
    x: float
    y: float
    at_fault: bool = True


@dataclass(frozen=True)
class EpisodeResult:
    """The whole episode: duration in s; distance driven, route_done and route_length in m; comfort: figures by name.

    Raises ValueError for values that cannot be measured.
    """

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


def plain(value: Any) -> Any:
    """The value as JSON knows it: rounded to DIGITS, and null where it is no number."""
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
    fields = as_type(values, _Result)
    return EpisodeResult(
        scenario=scenario_from_values(fields["scenario"]),
        outcome=Outcome[fields["outcome"].upper()],
        duration=fields["duration"],
        distance=fields["distance"],
        route_done=fields["route_done"],
        route_length=math.inf if fields["route_length"] is None else fields["route_length"],
        infractions=fields["infractions"],
        comfort=fields["comfort"],
    )


def result_values(result: EpisodeResult) -> dict[str, Any]:
    """An EpisodeResult in JSON's types; mean_speed in km/h."""
    infractions = [asdict(infraction) | {"kind": infraction.kind.value} for infraction in result.infractions]
    return {
        "scenario": scenario_values(result.scenario),
        "outcome": result.outcome.name.lower(),
        "message": result.outcome.value,
        "infractions": [{name: plain(value) for name, value in row.items()} for row in infractions],
        "comfort": {name: plain(value) for name, value in result.comfort.items()},
        "mean_speed": plain(mean_speed(result)),
        **{name: plain(getattr(result, name)) for name in ("duration", "distance", "route_done", "route_length")},
    }
