"""Metrics of a whole suite: pure functions over the results of its trials (tables 1 and 2 of the paper)."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from statistics import median, stdev

from caldrive.affordances import SPECS
from caldrive.benchmark.suites import COLLISIONS, TrialResult
from caldrive.driving.comfort import FRAME_METRICS
from caldrive.results import Infraction, InfractionKind, Outcome

Z95 = 1.959964  # of a normal distribution, two-sided
# Leaderboard 2.1: what an infraction adds to the denominator of the driving score.
PENALTIES = {
    InfractionKind.COLLISION_PERSON: 1.0, InfractionKind.COLLISION_CAR: 0.7, InfractionKind.COLLISION_OBJECT: 0.6,
    InfractionKind.RED_LIGHT: 0.4,
}  # fmt: skip


@dataclass(frozen=True)
class Cell:
    """A cell of the success table: a task in a condition."""

    condition: str
    task: str
    episodes: int
    """How many were driven."""
    successes: int
    """How many reached their goal in time."""
    clean: int
    """How many of these did so without an infraction of their own fault."""
    completion: float
    """Mean share of the routes that was covered, in [0, 1]."""
    score: float
    """Mean driving score, in [0, 100]."""
    deviation: float | None = None
    """Standard deviation of the success rate over the suite's repetitions, percent; None where there is one only."""

    @property
    def percent(self) -> float:
        """The success rate in percent."""
        return 100 * self.successes / self.episodes

    @property
    def interval(self) -> tuple[float, float]:
        """Wilson's 95 % interval of the success rate, percent."""
        low, high = wilson(self.successes, self.episodes)
        return 100 * low, 100 * high


def wilson(successes: int, n: int) -> tuple[float, float]:
    """Wilson's 95 % score interval of a share, both ends in [0, 1]."""
    if n == 0:
        return 0.0, 1.0
    share, z = successes / n, Z95**2 / n
    middle = (share + z / 2) / (1 + z)
    half = math.sqrt(z * share * (1 - share) + z**2 / 4) / (1 + z)
    return max(0.0, middle - half), min(1.0, middle + half)


@dataclass(frozen=True)
class Pair:
    """Two agents in the same episodes: how many goals each of them reached in time."""

    both: int
    first_alone: int
    second_alone: int
    neither: int

    @property
    def episodes(self) -> int:
        """How many both drove."""
        return self.both + self.first_alone + self.second_alone + self.neither

    @property
    def p_value(self) -> float:
        """McNemar's exact test, two-sided: how likely a difference as large is between two that are as good."""
        differ, fewer = self.first_alone + self.second_alone, min(self.first_alone, self.second_alone)
        return min(1.0, 2 * sum(math.comb(differ, k) for k in range(fewer + 1)) / (1 << differ))


def paired(first: Iterable[TrialResult], second: Iterable[TrialResult]) -> Pair:
    """Two agents' results in the episodes that both drove."""
    ours, theirs = ({result.trial.scenario: succeeded(result) for result in results} for results in (first, second))
    counts = Counter((ours[episode], theirs[episode]) for episode in ours.keys() & theirs.keys())
    return Pair(*(counts[pair] for pair in ((True, True), (True, False), (False, True), (False, False))))


def by_condition(results: Iterable[TrialResult]) -> dict[str, list[TrialResult]]:
    """The results of each condition, in the order of their first episodes."""
    groups: dict[str, list[TrialResult]] = {}
    for result in results:
        groups.setdefault(result.trial.condition, []).append(result)
    return groups


def cells(results: Iterable[TrialResult]) -> list[Cell]:
    """One for each condition and task, in the order of their first episodes."""
    groups: dict[tuple[str, str], list[TrialResult]] = {}
    for result in results:
        groups.setdefault((result.trial.condition, result.trial.scenario.task), []).append(result)
    return [_cell(condition, task, members) for (condition, task), members in groups.items()]


def _cell(condition: str, task: str, members: Sequence[TrialResult]) -> Cell:
    return Cell(
        condition=condition,
        task=task,
        episodes=len(members),
        successes=sum(succeeded(member) for member in members),
        clean=sum(is_clean(member) for member in members),
        completion=sum(route_completion(member) for member in members) / len(members),
        score=sum(driving_score(member) for member in members) / len(members),
        deviation=_deviation(members),
    )


def _deviation(members: Sequence[TrialResult]) -> float | None:
    """Of the success rates of a cell's repetitions, percent, with n - 1 in the denominator."""
    by_repetition: dict[int, list[bool]] = {}
    for member in members:
        by_repetition.setdefault(member.trial.repetition, []).append(succeeded(member))
    rates = [100 * sum(successes) / len(successes) for successes in by_repetition.values()]
    return stdev(rates) if len(rates) > 1 else None


def succeeded(result: TrialResult) -> bool:
    """Whether an episode reached its goal in time."""
    return result.episode.outcome is Outcome.SUCCESS


def is_clean(result: TrialResult) -> bool:
    """Whether an episode reached its goal without an infraction of its own fault; speeding is one where signs count."""
    return succeeded(result) and not any(infraction.at_fault for infraction in result.episode.infractions)


def route_completion(result: TrialResult) -> float:
    """Share of the route covered, in [0, 1]."""
    if succeeded(result):
        return 1.0
    return min(1.0, max(0.0, result.episode.route_done / result.episode.route_length))


def driving_score(result: TrialResult) -> float:
    """Leaderboard 2.1's driving score in [0, 100]: route completion, less the share of time off the lane, over one and
    the infractions' coefficients."""
    infractions = (infraction for infraction in result.episode.infractions if infraction.at_fault)
    penalty = sum(PENALTIES.get(infraction.kind, 0.0) for infraction in infractions)
    off_lane = float(result.metrics.get("off_lane", 0.0))
    return 100 * route_completion(result) * (1 - off_lane) / (1 + penalty)


@dataclass(frozen=True)
class InfractionRate:
    """How often an infraction of a kind was committed over a distance."""

    kind: InfractionKind
    count: int
    """Whoever's fault it was."""
    own: int
    """Those that were the agent's."""
    km: float
    """The distance driven."""

    @property
    def km_between(self) -> str:
        """Kilometres between two, as table 2 gives it: `>` where none occurred."""
        return f"> {self.km:.1f}" if self.count == 0 else f"{self.km / self.count:.2f}"


def infraction_rates(results: Sequence[TrialResult]) -> list[InfractionRate]:
    """Kilometres driven and infractions of each kind (table 2), whoever's fault they were, by the suite's rules."""
    return _rates(results, [i for result in results for i in result.episode.infractions])


def touch_rates(results: Sequence[TrialResult]) -> list[InfractionRate]:
    """Likewise everything that was touched, once a contact, however soft."""
    rates = _rates(results, [touch for result in results for touch in result.episode.touches])
    return [rate for rate in rates if rate.kind in COLLISIONS]


def _rates(results: Sequence[TrialResult], infractions: Sequence[Infraction]) -> list[InfractionRate]:
    km = sum(result.episode.distance for result in results) / 1000
    kinds, own = [i.kind for i in infractions], [i.kind for i in infractions if i.at_fault]
    return [InfractionRate(kind=kind, count=kinds.count(kind), own=own.count(kind), km=km) for kind in InfractionKind]


def speeding(results: Sequence[TrialResult]) -> tuple[float, float]:
    """Share of the time in [0, 1] that was faster than the signs allow, and by how much at most, km/h."""
    seconds = sum(result.episode.duration for result in results)
    too_fast = sum(result.episode.speeding * result.episode.duration for result in results)
    worst = max((result.episode.worst_excess for result in results), default=0.0)
    return (too_fast / seconds if seconds else 0.0), worst


def mean_comfort(results: Sequence[TrialResult]) -> dict[str, float]:
    """The metrics of supplement 3.2 over all episodes: median of the episodes' median centre-line distances in m, and,
    each episode weighted by its time, RMS jerks in m/s³, RMS changes of acceleration a frame in m/s² (where the
    episodes have them), and the share of time within nuPlan's bounds."""
    episodes = [(result.episode.comfort, result.episode.duration) for result in results]
    seconds = {
        "jerk": [duration for _, duration in episodes],
        "lateral_straight": [max(0.0, duration - comfort["turning"]) for comfort, duration in episodes],
        "lateral_turn": [comfort["turning"] for comfort, _ in episodes],
    }
    jerks = {
        name: math.sqrt(_mean([comfort[name] ** 2 for comfort, _ in episodes], seconds[name.removesuffix("_frame")]))
        for name in (*seconds, *FRAME_METRICS)
        if all(name in comfort for comfort, _ in episodes)
    }
    return {
        "center_distance": median(comfort["center_distance"] for comfort, _ in episodes) if episodes else 0.0,
        **jerks,
        "comfortable": _mean([comfort["comfortable"] for comfort, _ in episodes], seconds["jerk"]),
    }


def _mean(values: Sequence[float], weights: Sequence[float]) -> float:
    total = sum(weights)
    return sum(value * weight for value, weight in zip(values, weights, strict=True)) / total if total else 0.0


def red_light_counts(results: Sequence[TrialResult]) -> tuple[int, int]:
    """Red lights that the car stopped for or ran, and those that it ran."""
    obeyed = sum(int(result.metrics["reds_obeyed"]) for result in results)
    run = sum(i.kind is InfractionKind.RED_LIGHT for result in results for i in result.episode.infractions)
    return obeyed + run, run


def mean_errors(results: Sequence[TrialResult]) -> dict[str, float]:
    """How far the affordances were off while driving, weighted by time, without those that are never known: shares of
    wrong steps for the discrete ones, mean absolute errors in SI units for the others."""
    means: dict[str, float] = {}
    for spec in SPECS:
        metric = f"error/{spec.name}"
        known = [result for result in results if result.metrics.get(metric) is not None]
        if seconds := sum(result.episode.duration for result in known):
            means[spec.name] = sum(result.metrics[metric] * result.episode.duration for result in known) / seconds
    return means
