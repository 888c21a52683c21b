"""How an episode went: its outcome, its infractions and its figures."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from enum import Enum

from caldrive.datatypes import Scenario


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
