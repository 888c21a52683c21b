"""What a suite's episodes say together: pure functions over results (tables 1 and 2 of the paper)."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from statistics import median

from caldrive.benchmark.behaviour import NAMES
from caldrive.benchmark.suites import Driven
from caldrive.results import InfractionKind, Outcome

Z95 = 1.959964  # of a normal distribution, two-sided
# Leaderboard 2.1: what an infraction adds to the denominator of the driving score.
PENALTIES = {
    InfractionKind.COLLISION_PERSON: 1.0, InfractionKind.COLLISION_CAR: 0.7, InfractionKind.COLLISION_OBJECT: 0.6,
    InfractionKind.RED_LIGHT: 0.4,
}  # fmt: skip


@dataclass(frozen=True)
class Cell:
    """A task in a condition: episodes, successes, those of them without an infraction of one's own fault, share of the
    routes covered, and the driving score in [0, 100]."""

    condition: str
    task: str
    episodes: int
    successes: int
    clean: int
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
        sum(clean(one) for one in members),
        sum(completion(one) for one in members) / n,
        sum(driving_score(one) for one in members) / n,
    )


def clean(one: Driven) -> bool:
    """Whether an episode reached its goal without a collision, red light, opposite lane or sidewalk of its own
    fault."""
    return one.result.outcome is Outcome.SUCCESS and not any(broken.at_fault for broken in one.result.infractions)


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


def comfort(driven: Sequence[Driven]) -> dict[str, float]:
    """Figures of supplement 3.2 over all episodes: median of the episodes' median centre-line distances in m, and, each
    episode weighted by its time, RMS jerks in m/s³ and the share of time within nuPlan's bounds."""
    drives = [(one.result.comfort, one.result.duration) for one in driven]

    def mean(name: str, power: int, weights: Iterable[float]) -> float:
        weighed = [(c[name] ** power, w) for (c, _), w in zip(drives, weights, strict=True)]
        whole = sum(w for _, w in weighed)
        return (sum(v * w for v, w in weighed) / whole) ** (1 / power) if whole else 0.0

    return {
        "center_distance": median(c["center_distance"] for c, _ in drives) if drives else 0.0,
        "jerk": mean("jerk", 2, (time for _, time in drives)),
        "lateral_straight": mean("lateral_straight", 2, (max(0.0, time - c["turning"]) for c, time in drives)),
        "lateral_turn": mean("lateral_turn", 2, (c["turning"] for c, _ in drives)),
        "comfortable": mean("comfortable", 1, (time for _, time in drives)),
    }


def reds(driven: Sequence[Driven]) -> tuple[int, int]:
    """Red lights that the car stopped for or ran, and those it ran."""
    obeyed = sum(int(one.figures["reds_obeyed"]) for one in driven)
    run = sum(i.kind is InfractionKind.RED_LIGHT for one in driven for i in one.result.infractions)
    return obeyed + run, run


def errors(driven: Sequence[Driven]) -> dict[str, float]:
    """What the affordances were off by while driving, weighted by time: shares of frames for the discrete ones, mean
    absolute errors in SI units for the others."""
    found: dict[str, float] = {}
    for name in NAMES:
        known = [one for one in driven if one.figures.get(f"error/{name}") is not None]
        if whole := sum(one.result.duration for one in known):
            found[name] = sum(one.figures[f"error/{name}"] * one.result.duration for one in known) / whole
    return found
