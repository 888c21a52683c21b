"""The report's tables as rows of text: every figure of the paper's tables beside ours."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from caldrive.benchmark.failure_causes import common_places
from caldrive.benchmark.metrics import cells, comfort, errors, rates, reds
from caldrive.benchmark.published import COMFORT, SYSTEMS, km_between, success
from caldrive.benchmark.report.runs import UNITS, BenchmarkRun, conditions, failures
from caldrive.benchmark.suites import Driven

DYNAMIC, ALL = "navigation-dynamic", "all"  # tasks whose infractions are counted together


@dataclass(frozen=True)
class Table:
    """A table of the report: title, a sentence on it, heads of the columns, and rows of text."""

    title: str
    text: str
    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


def tables(runs: Sequence[BenchmarkRun]) -> list[Table]:
    """All tables of the report: the runs, their success, and of the others those that say something."""
    others = _infractions(runs), _lights(runs), _comfort(runs), _errors(runs), _causes(runs)
    return [_about(runs), _success(runs), *(table for table in others if table.rows)]


def _about(runs: Sequence[BenchmarkRun]) -> Table:
    rows = [
        (
            run.name, run.about["suite"], str(len(run.driven)), str(run.about["model"] or ""), run.about["code"],
            run.about["began"][:16].replace("T", " "), run.about["machine"], run.command,
        )
        for run in runs
    ]  # fmt: skip
    head = ("agent", "suite", "episodes", "model", "code", "began (UTC)", "machine", "command")
    return Table("Runs", "What drove, and what to type to see it again.", head, tuple(rows))


def _success(runs: Sequence[BenchmarkRun]) -> Table:
    found = {(run.name, cell.condition, cell.task): cell for run in runs for cell in cells(run.driven)}
    rows = []
    for condition, task in dict.fromkeys(key[1:] for key in found):
        row = [condition, task]
        for run in runs:
            cell = found.get((run.name, condition, task))
            low, high = cell.interval if cell else (0, 0)
            row.append(
                f"{cell.percent:.0f} ({low:.0f}-{high:.0f}, {cell.successes} of {cell.episodes})" if cell else ""
            )
            row.append(f"{100 * cell.clean / cell.episodes:.0f}" if cell else "")
            row.append(f"{100 * cell.completion:.0f}" if cell else "")
            row.append(f"{cell.score:.0f}" if cell else "")
        published = [success(system, condition, task) for system in SYSTEMS]
        rows.append((*row, *("" if value is None else str(value) for value in published)))
    ours = [
        head
        for run in runs
        for head in (f"{run.name} %", f"{run.name} clean %", f"{run.name} route %", f"{run.name} score")
    ]
    text = (
        "Percent of the episodes that reached their goal in time, with Wilson's 95 % interval; percent that did so "
        "clean, without an infraction of their own fault; share of the routes covered; driving score of Leaderboard "
        "2.1. The paper's systems drove in CARLA."
    )
    head = ("condition", "task", *ours, *(f"{system} (paper)" for system in SYSTEMS))
    return Table("Success", text, head, tuple(rows))


def _infractions(runs: Sequence[BenchmarkRun]) -> Table:
    rows = []
    for condition in conditions(runs):
        for tasks in (DYNAMIC, ALL):
            found = [rates([one for one in run.only(condition) if _among(one, tasks)]) for run in runs]
            for column in zip(*found, strict=True) if any(rate[0].km for rate in found) else ():
                kind = column[0].kind
                published = [km_between(system, condition, kind) if tasks == DYNAMIC else "" for system in SYSTEMS]
                ours = (f"{rate.km_between} ({rate.count})" for rate in column)
                rows.append((condition, tasks, kind.value, *ours, *published))
    text = (
        "Kilometres between two infractions and how many there were; > where there was none in so many kilometres. "
        "The benchmark counts infractions in navigation among others, where the paper's figures stand."
    )
    systems = (f"{system} (paper)" for system in SYSTEMS)
    return Table(
        "Infractions", text, ("condition", "tasks", "infraction", *(run.name for run in runs), *systems), tuple(rows)
    )


def _among(one: Driven, tasks: str) -> bool:
    return tasks == ALL or one.trial.scenario.task == tasks


def _lights(runs: Sequence[BenchmarkRun]) -> Table:
    rows = []
    for condition in conditions(runs):
        for run in runs:
            met, broken = reds(run.only(condition))
            share = f"{100 * (met - broken) / met:.1f}" if met else ""
            rows.append((condition, run.name, str(met), str(met - broken), share))
    text = "Red lights that an agent stopped for or ran; those that turned green before it stood do not count."
    return Table("Red lights", text, ("condition", "agent", "met", "obeyed", "%"), tuple(rows))


def _comfort(runs: Sequence[BenchmarkRun]) -> Table:
    names = {
        "center_distance": "centre distance, median m", "jerk": "jerk m/s³", "lateral_straight": "lateral, straight",
        "lateral_turn": "lateral, turns", "comfortable": "in nuPlan's bounds %",
    }  # fmt: skip
    rows = []
    for run in runs:
        for condition in ("all", *conditions([run])):
            found = comfort(run.driven if condition == "all" else run.only(condition))
            values = [f"{100 * v:.1f}" if k == "comfortable" else f"{v:.3f}" for k, v in found.items()]
            rows.append((run.name, condition, *values))
    rows.append(("CAL (paper)", "training", *(f"{COMFORT[name]:.3f}" for name in list(names)[:4]), ""))
    text = "Median distance to the centre line and RMS jerk (supplement 3.2), and the share of time in comfort."
    return Table("Driving behaviour", text, ("agent", "condition", *names.values()), tuple(rows))


def _errors(runs: Sequence[BenchmarkRun]) -> Table:
    found = {
        (run.name, condition): errors(run.only(condition)) for run in runs for condition in conditions([run])
    }  # fmt: skip
    names = list(dict.fromkeys(name for values in found.values() for name in values))
    rows = [
        (*place, *(_error(name, values[name]) if name in values else "" for name in names))
        for place, values in found.items()
        if values  # an agent may give no affordances
    ]
    heads = (f"{name.replace('_', ' ')} {UNITS.get(name, '% wrong')}" for name in names)
    text = "What the affordances were off by while driving: share of wrong frames, or mean absolute error."
    return Table("Affordances while driving", text, ("agent", "condition", *heads), tuple(rows))


def _error(name: str, value: float) -> str:
    return f"{value:.3f}" if name in UNITS else f"{100 * value:.2f}"


def _causes(runs: Sequence[BenchmarkRun]) -> Table:
    rows = []
    found = failures(runs)
    for run in runs:
        for town in dict.fromkeys(one.trial.scenario.town for one in run.driven):
            causes = [f.cause for f in found if f.run == run.name and f.episode.trial.scenario.town == town and f.cause]
            for (what, x, y, command), count in common_places(causes):
                rows.append((run.name, Path(town).stem, what, f"({x}, {y})", command, str(count)))
    text = "What the car did wrong first in the episodes that missed their goal, and near which place."
    return Table("How missed goals began", text, ("agent", "town", "what", "near", "command", "episodes"), tuple(rows))
