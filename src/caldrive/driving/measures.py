"""What a suite's episodes say together: pure functions over results (tables 1 and 2 of the paper)."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from caldrive.driving.benchmark import Driven
from caldrive.results import InfractionKind, Outcome

Z95 = 1.959964  # of a normal distribution, two-sided
# Published success rates in percent: straight, one turn, navigation, navigation dynamic (table 1).
PAPER_SUCCESS = {
    "MP": {"training": (98, 82, 80, 77), "new weather": (100, 95, 94, 89), "new town": (92, 61, 24, 24),
           "new town + weather": (50, 50, 47, 44)},
    "CIL": {"training": (95, 89, 86, 83), "new weather": (98, 90, 84, 82), "new town": (97, 59, 40, 38),
            "new town + weather": (80, 48, 44, 42)},
    "RL": {"training": (89, 34, 14, 7), "new weather": (86, 16, 2, 2), "new town": (74, 12, 3, 2),
           "new town + weather": (68, 20, 6, 4)},
    "CAL": {"training": (100, 97, 92, 83), "new weather": (100, 96, 90, 82), "new town": (93, 82, 70, 64),
            "new town + weather": (94, 72, 68, 64)},
}  # fmt: skip
# Leaderboard 2.1: what an infraction adds to the denominator of the driving score.
PENALTIES = {
    InfractionKind.COLLISION_PERSON: 1.0, InfractionKind.COLLISION_CAR: 0.7, InfractionKind.COLLISION_OBJECT: 0.6,
    InfractionKind.RED_LIGHT: 0.4,
}  # fmt: skip


@dataclass(frozen=True)
class Cell:
    """A task in a condition: episodes, successes, share of the routes covered, and the driving score in [0, 100]."""

    condition: str
    task: str
    episodes: int
    successes: int
    completion: float
    score: float

    @property
    def percent(self) -> float:
        return 100 * self.successes / self.episodes

    @property
    def interval(self) -> tuple[float, float]:
        """Wilson's 95 % interval of the success rate, percent."""
        low, high = wilson(self.successes, self.episodes)
        return 100 * low, 100 * high


def wilson(successes: int, n: int) -> tuple[float, float]:
    """Wilson's 95 % score interval of a share."""
    if n == 0:
        return 0.0, 1.0
    share, z = successes / n, Z95**2 / n
    middle = (share + z / 2) / (1 + z)
    half = math.sqrt(z * share * (1 - share) + z**2 / 4) / (1 + z)
    return max(0.0, middle - half), min(1.0, middle + half)


def cells(driven: Iterable[Driven]) -> list[Cell]:
    """One for each condition and task, in the order of their first episodes."""
    groups: dict[tuple[str, str], list[Driven]] = {}
    for one in driven:
        groups.setdefault((one.trial.condition, one.trial.scenario.task), []).append(one)
    return [_cell(condition, task, members) for (condition, task), members in groups.items()]


def _cell(condition: str, task: str, members: Sequence[Driven]) -> Cell:
    n = len(members)
    return Cell(
        condition,
        task,
        n,
        sum(one.result.outcome is Outcome.SUCCESS for one in members),
        sum(completion(one) for one in members) / n,
        sum(driving_score(one) for one in members) / n,
    )


def completion(one: Driven) -> float:
    """Share of the route covered."""
    if one.result.outcome is Outcome.SUCCESS:
        return 1.0
    return min(1.0, max(0.0, one.result.route_done / one.result.route_length))


def driving_score(one: Driven) -> float:
    """Leaderboard 2.1's driving score in [0, 100]: completion, less the share of time off the lane, over one and the
    infractions' coefficients."""
    broken = sum(PENALTIES.get(infraction.kind, 0.0) for infraction in one.result.infractions if infraction.at_fault)
    off_lane = float(one.figures.get("off_lane", 0.0))
    return 100 * completion(one) * (1 - off_lane) / (1 + broken)


@dataclass(frozen=True)
class Rate:
    """How often an infraction of a kind was committed over a distance."""

    kind: InfractionKind
    count: int
    km: float

    @property
    def km_between(self) -> str:
        """Kilometres between two, as table 2 says it: `>` where none occurred."""
        return f"> {self.km:.1f}" if self.count == 0 else f"{self.km / self.count:.2f}"


def rates(driven: Sequence[Driven]) -> list[Rate]:
    """Kilometres driven and infractions of each kind (table 2); collisions that others cause do not count."""
    km = sum(one.result.distance for one in driven) / 1000
    broken = [infraction for one in driven for infraction in one.result.infractions if infraction.at_fault]
    return [Rate(kind, sum(one.kind is kind for one in broken), km) for kind in InfractionKind]
