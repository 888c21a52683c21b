"""How an episode went: its outcome, its infractions and its figures, in Python and in JSON."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import asdict, dataclass, field
from enum import Enum
from typing import Any, Literal, NotRequired, TypedDict

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
    """The paper's six kinds of infraction (section 3); NoCrash's lights that are not green; and speeding: "the speed
    limit must be obeyed at all times"."""

    OPPOSITE_LANE = "opposite lane"
    SIDEWALK = "sidewalk"
    RED_LIGHT = "red light"
    COLLISION_OBJECT = "collision with object"
    COLLISION_CAR = "collision with car"
    COLLISION_PERSON = "collision with person"
    YELLOW_LIGHT = "yellow light"
    SPEEDING = "speeding"


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

    rules: by which infractions were counted, see `driving.rules`. touches: everything that was touched, once a contact,
    however soft. speeding: share of the time in [0, 1] that was faster than the signs allow; worst_excess: by how much
    at most, km/h. Raises ValueError for values that cannot be measured.
    """

    scenario: Scenario
    outcome: Outcome
    duration: float
    distance: float
    route_done: float
    route_length: float
    infractions: tuple[Infraction, ...] = ()
    comfort: dict[str, float] = field(default_factory=dict)
    rules: str = "corl2017"
    touches: tuple[Infraction, ...] = ()
    speeding: float = 0.0
    worst_excess: float = 0.0

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
    rules: NotRequired[str]
    touches: NotRequired[tuple[Infraction, ...]]
    speeding: NotRequired[float]
    worst_excess: NotRequired[float]


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
        rules=fields.get("rules", "corl2017"),
        touches=fields.get("touches", ()),
        speeding=fields.get("speeding", 0.0),
        worst_excess=fields.get("worst_excess", 0.0),
    )


def result_values(result: EpisodeResult) -> dict[str, Any]:
    """An EpisodeResult in JSON's types; mean_speed in km/h."""
    numbers = ("duration", "distance", "route_done", "route_length", "speeding", "worst_excess")
    return {
        "scenario": scenario_values(result.scenario),
        "outcome": result.outcome.name.lower(),
        "message": result.outcome.value,
        "rules": result.rules,
        "infractions": _infraction_values(result.infractions),
        "touches": _infraction_values(result.touches),
        "comfort": {name: plain(value) for name, value in result.comfort.items()},
        "mean_speed": plain(mean_speed(result)),
        **{name: plain(getattr(result, name)) for name in numbers},
    }


def _infraction_values(infractions: Iterable[Infraction]) -> list[dict[str, Any]]:
    rows = [asdict(infraction) | {"kind": infraction.kind.value} for infraction in infractions]
    return [{name: plain(value) for name, value in row.items()} for row in rows]
