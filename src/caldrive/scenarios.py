"""A scenario: the conditions of one episode, in Python and in JSON (recordings, results and suites keep it)."""

from __future__ import annotations

import math
import re
from dataclasses import asdict, astuple, dataclass
from typing import Any, NamedTuple

from caldrive.datatypes import Pose
from caldrive.files import as_type

MOST_SEED = 2**53  # that JSON keeps exactly, as a number in 64 bits
TOWNS = ("town01", "town02")  # in the package; others are generated, or OpenDRIVE files
JUDGING_TOWN = "town02"
GENERATED = ("random", "random-wide")  # kinds of generated towns; random:7 is one
HELD_OUT_FROM = 9_000_000  # seeds of generated towns that only judge: nothing is recorded, tuned or chosen there
WEATHERS = range(1, 15)  # CARLA's


class GeneratedTown(NamedTuple):
    """A town that follows from a seed."""

    kind: str
    """One of GENERATED."""
    seed: int

    @property
    def name(self) -> str:
        """As in a scenario."""
        return f"{self.kind}:{self.seed}"

    @property
    def is_held_out(self) -> bool:
        """Whether it is there to judge only."""
        return self.seed >= HELD_OUT_FROM


def generated_town(town: str) -> GeneratedTown | None:
    """The generated town of a name such as random:7; None for a name of another form. Raises ValueError for a seed that
    cannot be."""
    kind, colon, seed = town.partition(":")
    if kind not in GENERATED or not colon:
        return None
    if re.fullmatch(r"0|[1-9][0-9]{0,9}", seed, re.ASCII) is None:  # each town has one name
        raise ValueError(f"found town {town!r}, wanted a seed from 0 to 9999999999: type --town {kind}:7")
    return GeneratedTown(kind, int(seed))


def require_to_learn_from(town: str) -> None:
    """Raises ValueError for a town that is there to judge only: nothing learns from it, though it may be recorded to
    measure what has learnt."""
    if town == JUDGING_TOWN:
        raise ValueError(f"found {town} to learn from, wanted another, as that town only judges: take {TOWNS[0]}")
    require_not_held_out(town)


def require_not_held_out(town: str) -> None:
    """Raises ValueError for a generated town that is there to judge only."""
    generated = generated_town(town)
    if generated is not None and generated.is_held_out:
        raise ValueError(
            f"found {town} to learn from, wanted a seed below {HELD_OUT_FROM}, as towns from there on only judge: "
            f"type --town {generated.kind}:7"
        )


@dataclass(frozen=True)
class Scenario:
    """The conditions of one episode. Raises ValueError for values that cannot be."""

    town: str
    """A town's name, such as town01 or random:7, or the path of an OpenDRIVE file."""
    weather: int
    """One of CARLA's weathers, 1 to 14."""
    start: Pose
    """Where the ego begins: its centre, and its heading."""
    goal: Pose
    """Where the episode succeeds."""
    n_vehicles: int = 0
    """Other cars."""
    n_pedestrians: int = 0
    """Pedestrians."""
    time_limit: float = math.inf
    """s until the episode ends without success."""
    seed: int = 0
    """Decides everything random: traffic, pedestrians, lights."""
    task: str = ""
    """The task's name, for tables."""
    crossing: float = 1.0
    """How many times as often as usual pedestrians cross the road."""

    def __post_init__(self) -> None:
        for name in ("n_vehicles", "n_pedestrians", "seed", "crossing"):
            if not 0 <= getattr(self, name) < math.inf:
                raise ValueError(f"{name} is {getattr(self, name)}, but must be 0 or more: give a scenario that can be")
        if self.seed >= MOST_SEED:
            raise ValueError(f"seed is {self.seed}, but must be less than 2**53: give a scenario that can be")
        if not self.time_limit > 0:
            raise ValueError(f"time_limit is {self.time_limit}, but must be more than 0 s: give it some time")
        if not all(math.isfinite(value) for pose in (self.start, self.goal) for value in astuple(pose)):
            raise ValueError(f"start or goal of {self.town} is no place: give x, y and heading as numbers")


def scenario_values(scenario: Scenario) -> dict[str, Any]:
    """A scenario in JSON's types; an infinite time limit becomes null."""
    return asdict(scenario) | {"time_limit": None if math.isinf(scenario.time_limit) else scenario.time_limit}


def scenario_from_values(values: dict[str, Any]) -> Scenario:
    """The inverse of `scenario_values`. Raises ValueError for what is no scenario."""
    return as_type({name: value for name, value in values.items() if (name, value) != ("time_limit", None)}, Scenario)
