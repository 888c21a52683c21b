"""The report's tables as rows of text: every number of the paper's tables beside ours."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from caldrive.affordances import BY_NAME, AffordanceSpec
from caldrive.benchmark.failure_causes import common_places
from caldrive.benchmark.metrics import (
    Cell,
    infraction_rates,
    mean_comfort,
    mean_errors,
    red_light_counts,
    succeeded,
)
from caldrive.benchmark.published import COMFORT, SYSTEMS, km_between, success
from caldrive.benchmark.report.runs import BenchmarkRun, cells_by_place, conditions
from caldrive.benchmark.suites import TrialResult

DYNAMIC, ALL = "navigation-dynamic", "all"  # tasks whose infractions are counted together
COMFORT_HEADS = {
    "center_distance": "centre distance, median m", "jerk": "jerk m/s³", "lateral_straight": "lateral, straight",
    "lateral_turn": "lateral, turns", "comfortable": "in nuPlan's bounds %",
}  # fmt: skip


@dataclass(frozen=True)
class Table:
    """A table of the report."""

    title: str
    text: str
    """A sentence on it."""
    head: tuple[str, ...]
    """The names of its columns."""
    rows: tuple[tuple[str, ...], ...]
    """Each as long as the head."""


def tables(runs: Sequence[BenchmarkRun]) -> list[Table]:
    """All tables of the report: the runs, their success, and of the others those that are not empty."""
    others = [
        _infractions(runs), _red_lights(runs), _comfort(runs), _affordance_errors(runs), _failure_causes(runs)
    ]  # fmt: skip
    return [_runs(runs), _success(runs), *(table for table in [_problems(runs), *others] if table.rows)]


def _problems(runs: Sequence[BenchmarkRun]) -> Table:
    rows = tuple((run.name, problem) for run in runs for problem in run.problems)
    return Table(
        title="Problems", text=f"What is wrong with these results: {len(rows)}.", head=("agent", "what"), rows=rows
    )


def headline(runs: Sequence[BenchmarkRun]) -> str:
    """The report in a sentence for each run, first of all where something is wrong with it."""
    sentences = []
    for run in runs:
        reached = sum(succeeded(result) for result in run.results)
        km = sum(result.episode.distance for result in run.results) / 1000
        faults = sum(infraction.at_fault for result in run.results for infraction in result.episode.infractions)
        said = f"{run.name}: {reached} of {len(run.results)} goals reached in time, "
        said += f"{counted(faults, 'infraction')} in {km:.0f} km"
        sentences.append(f"{said} (see Problems)" if run.problems else said)
    return "; ".join(sentences) + "."


def counted(n: int, noun: str) -> str:
    """A number of things in words: 1 episode, 2 episodes."""
    return f"{n} {noun}{'' if n == 1 else 's'}"


def _runs(runs: Sequence[BenchmarkRun]) -> Table:
    rows = [
        (
            run.name, run.description["suite"], str(len(run.results)), str(run.description["model"] or ""),
            run.description["code"], run.description["began"][:16].replace("T", " "), run.description["machine"],
            run.command,
        )
        for run in runs
    ]  # fmt: skip
    head = ("agent", "suite", "episodes", "model", "code", "began (UTC)", "machine", "command")
    return Table(title="Runs", text="What drove, and what to type to see it again.", head=head, rows=tuple(rows))


def _success(runs: Sequence[BenchmarkRun]) -> Table:
    by_place = cells_by_place(runs)
    rows = []
    for condition, task in dict.fromkeys(key[1:] for key in by_place):
        ours = [value for run in runs for value in _cell_texts(by_place.get((run.name, condition, task)))]
        published = [success(system, condition, task) for system in SYSTEMS]
        rows.append((condition, task, *ours, *("" if value is None else str(value) for value in published)))
    heads = [f"{run.name} {metric}" for run in runs for metric in ("%", "clean %", "route %", "score")]
    text = (
        "Percent of the episodes that reached their goal in time, with Wilson's 95 % interval; percent that did so "
        "clean, without an infraction of their own fault; share of the routes covered; driving score of Leaderboard "
        "2.1. The paper's systems drove in CARLA."
    )
    head = ("condition", "task", *heads, *_published_heads())
    return Table(title="Success", text=text, head=head, rows=tuple(rows))


def _cell_texts(cell: Cell | None) -> tuple[str, str, str, str]:
    """Success, clean, route and score of a cell; empty where a run has not driven it."""
    if cell is None:
        return "", "", "", ""
    low, high = cell.interval
    return (
        f"{cell.percent:.0f} ({low:.0f}-{high:.0f}, {cell.successes} of {cell.episodes})",
        f"{100 * cell.clean / cell.episodes:.0f}",
        f"{100 * cell.completion:.0f}",
        f"{cell.score:.0f}",
    )


def _published_heads() -> tuple[str, ...]:
    return tuple(f"{system} (paper)" for system in SYSTEMS)


def _infractions(runs: Sequence[BenchmarkRun]) -> Table:
    rows = []
    for condition in conditions(runs):
        for tasks in (DYNAMIC, ALL):
            rates = [infraction_rates(_of_tasks(run.of_condition(condition), tasks)) for run in runs]
            if not any(rates_of_run[0].km for rates_of_run in rates):
                continue
            for rates_of_kind in zip(*rates, strict=True):
                kind = rates_of_kind[0].kind
                published = [km_between(system, condition, kind) if tasks == DYNAMIC else "" for system in SYSTEMS]
                ours = (f"{rate.km_between} ({rate.count})" for rate in rates_of_kind)
                rows.append((condition, tasks, kind.value, *ours, *published))
    text = (
        "Kilometres between two infractions and how many there were; > where there was none in so many kilometres. "
        "The paper counts infractions in the task navigation-dynamic only."
    )
    head = ("condition", "tasks", "infraction", *(run.name for run in runs), *_published_heads())
    return Table(title="Infractions", text=text, head=head, rows=tuple(rows))


def _of_tasks(results: Sequence[TrialResult], tasks: str) -> list[TrialResult]:
    return [result for result in results if tasks in (ALL, result.trial.scenario.task)]


def _red_lights(runs: Sequence[BenchmarkRun]) -> Table:
    rows = []
    for condition in conditions(runs):
        for run in runs:
            met, ran = red_light_counts(run.of_condition(condition))
            share = f"{100 * (met - ran) / met:.1f}" if met else ""
            rows.append((condition, run.name, str(met), str(met - ran), share))
    text = "Red lights that an agent stopped for or ran; those that turned green before it stood do not count."
    return Table(title="Red lights", text=text, head=("condition", "agent", "met", "obeyed", "%"), rows=tuple(rows))


def _comfort(runs: Sequence[BenchmarkRun]) -> Table:
    rows = []
    for run in runs:
        for condition in ("all", *conditions([run])):
            means = mean_comfort(run.results if condition == "all" else run.of_condition(condition))
            values = (f"{100 * v:.1f}" if name == "comfortable" else f"{v:.3f}" for name, v in means.items())
            rows.append((run.name, condition, *values))
    published = (f"{COMFORT[name]:.3f}" if name in COMFORT else "" for name in COMFORT_HEADS)
    rows.append(("CAL (paper)", "training", *published))
    text = "Median distance to the centre line and RMS jerk (supplement 3.2), and the share of time in comfort."
    head = ("agent", "condition", *COMFORT_HEADS.values())
    return Table(title="Driving behaviour", text=text, head=head, rows=tuple(rows))


def _affordance_errors(runs: Sequence[BenchmarkRun]) -> Table:
    errors = {(run.name, name): mean_errors(run.of_condition(name)) for run in runs for name in conditions([run])}
    specs = [BY_NAME[name] for name in dict.fromkeys(name for values in errors.values() for name in values)]
    rows = [
        (*place, *(_error_text(spec, values.get(spec.name)) for spec in specs))
        for place, values in errors.items()
        if values  # an agent may give no affordances
    ]
    heads = (f"{spec.title} {'% wrong' if spec.discrete else spec.unit}" for spec in specs)
    text = "How far the affordances were off while driving: share of wrong steps, or mean absolute error."
    head = ("agent", "condition", *heads)
    return Table(title="Affordances while driving", text=text, head=head, rows=tuple(rows))


def _error_text(spec: AffordanceSpec, error: float | None) -> str:
    if error is None:
        return ""
    return f"{100 * error:.2f}" if spec.discrete else f"{error:.3f}"


def _failure_causes(runs: Sequence[BenchmarkRun]) -> Table:
    rows = []
    for run in runs:
        for town in dict.fromkeys(result.trial.scenario.town for result in run.results):
            in_town = [failure for failure in run.failures if failure.result.trial.scenario.town == town]
            causes = [failure.cause for failure in in_town if failure.cause is not None]
            for (event, x, y, command), count in common_places(causes):
                rows.append((run.name, Path(town).stem, event, f"({x}, {y})", command, str(count)))
    text = "What the car did wrong first in the episodes that missed their goal, and near which place."
    head = ("agent", "town", "what", "near", "command", "episodes")
    return Table(title="Failure causes", text=text, head=head, rows=tuple(rows))
