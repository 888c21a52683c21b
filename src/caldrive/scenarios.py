"""The vocabulary that every part of caldrive shares, as frozen dataclasses.

Units are SI, axes are ISO 8855: x forward (or east), y left (or north), headings counter-clockwise in radians.
Speeds on signs are the one exception: they are the km/h that stand on the sign.
"""

from __future__ import annotations

import math
from dataclasses import asdict, astuple, dataclass
from typing import Any

from caldrive.datatypes import Pose
from caldrive.files import as_type


@dataclass(frozen=True)
class Scenario:
    """One episode's conditions. town: a name or the path of an .xodr file. time_limit in s. crossing: how many times
    as often as usual pedestrians cross."""

    town: str
    weather: int
    start: Pose
    goal: Pose
    n_vehicles: int = 0
    n_pedestrians: int = 0
    time_limit: float = math.inf
    seed: int = 0
    task: str = ""
    crossing: float = 1.0

    def __post_init__(self) -> None:
        for name in ("n_vehicles", "n_pedestrians", "seed", "crossing"):
            if not 0 <= getattr(self, name) < math.inf:
                raise ValueError(f"{name} is {getattr(self, name)}, but must be 0 or more: give a scenario that can be")
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
