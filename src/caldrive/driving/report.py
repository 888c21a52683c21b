"""The report on one or more benchmark folders: every figure of the paper's tables beside ours, as rows of text.

`report_text` writes them as Markdown, `report_page` as a page.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from caldrive.driving.benchmark import Driven, read_results, read_run
from caldrive.driving.measures import cells, comfort, errors, rates, reds
from caldrive.driving.published import COMFORT, SYSTEMS, km_between, success
from caldrive.driving.settings import BenchmarkSettings
from caldrive.results import Outcome

UNITS = {"vehicle_distance": "m", "relative_angle": "rad", "center_distance": "m"}


@dataclass(frozen=True)
class Run:
    """One folder: its name in the report, its description, and its episodes."""

    name: str
    folder: Path
    about: dict[str, Any]
    driven: tuple[Driven, ...]

    def only(self, condition: str) -> list[Driven]:
        """The episodes of one condition."""
        return [one for one in self.driven if one.trial.condition == condition]

    @property
    def command(self) -> str:
        """What to type for these results."""
        pace = "--signs" if self.about["cap"] is None else f"--cap {self.about['cap']:g}"
        return f"caldrive benchmark --suite {self.about['suite']} --agent {self.about['agent']} {pace} --out DIR"


@dataclass(frozen=True)
class Table:
    """A table of the report: title, a sentence on it, heads of the columns, and rows of text."""

    title: str
    text: str
    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


def load_run(folder: Path) -> Run:
    """Reads a benchmark's folder. Raises ValueError where there is none, or nothing in it."""
    about = read_run(folder)
    settings = BenchmarkSettings(
        suite=about["suite"], agent=about["agent"], out=folder, seed=about["seed"], time_limit=about["time_limit"]
    )
    driven = read_results(settings)
    if not driven:
        raise ValueError(f"found no episode in {folder}, wanted some: type caldrive benchmark --out {folder}")
    return Run(about["agent"], folder, about, tuple(driven))


def load_runs(folders: Sequence[Path]) -> list[Run]:
    """All folders; runs of one agent are told apart by their folders' names."""
    runs = [load_run(folder) for folder in folders]
    names = [run.name for run in runs]
    return [replace(run, name=f"{run.name} ({run.folder.name})") if names.count(run.name) > 1 else run for run in runs]


def conditions(runs: Sequence[Run]) -> list[str]:
    """All conditions in the order in which they first appear."""
    return list(dict.fromkeys(one.trial.condition for run in runs for one in run.driven))


def tables(runs: Sequence[Run]) -> list[Table]:
    """All tables of the report."""
    return [_about(runs), _success(runs), _infractions(runs), _lights(runs), _comfort(runs), _errors(runs)]


def _about(runs: Sequence[Run]) -> Table:
    rows = [
        (
            run.name, run.about["suite"], str(len(run.driven)), str(run.about["model"] or ""), run.about["code"],
            run.about["began"][:16].replace("T", " "), run.about["machine"], run.command,
        )
        for run in runs
    ]  # fmt: skip
    head = ("agent", "suite", "episodes", "model", "code", "began (UTC)", "machine", "command")
    return Table("Runs", "What drove, and what to type to see it again.", head, tuple(rows))


def _success(runs: Sequence[Run]) -> Table:
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
            row.append(f"{100 * cell.completion:.0f}" if cell else "")
            row.append(f"{cell.score:.0f}" if cell else "")
        published = [success(system, condition, task) for system in SYSTEMS]
        rows.append((*row, *("" if value is None else str(value) for value in published)))
    ours = [head for run in runs for head in (f"{run.name} %", f"{run.name} route %", f"{run.name} score")]
    text = (
        "Percent of the episodes that reached their goal in time, with Wilson's 95 % interval; share of the routes "
        "covered; driving score of Leaderboard 2.1. The paper's systems drove in CARLA."
    )
    head = ("condition", "task", *ours, *(f"{system} (paper)" for system in SYSTEMS))
    return Table("Success", text, head, tuple(rows))


def _infractions(runs: Sequence[Run]) -> Table:
    rows = []
    for condition in conditions(runs):
        found = [rates(run.only(condition)) for run in runs]
        for column in zip(*found, strict=True):
            kind = column[0].kind
            published = [km_between(system, condition, kind) for system in SYSTEMS]
            rows.append((condition, kind.value, *(f"{rate.km_between} ({rate.count})" for rate in column), *published))
    text = "Kilometres between two infractions and how many there were; > where there was none in so many kilometres."
    head = ("condition", "infraction", *(run.name for run in runs), *(f"{system} (paper)" for system in SYSTEMS))
    return Table("Infractions", text, head, tuple(rows))


def _lights(runs: Sequence[Run]) -> Table:
    rows = []
    for condition in conditions(runs):
        for run in runs:
            met, broken = reds(run.only(condition))
            share = f"{100 * (met - broken) / met:.1f}" if met else ""
            rows.append((condition, run.name, str(met), str(met - broken), share))
    text = "Red lights that an agent came up to, and those it stopped for."
    return Table("Red lights", text, ("condition", "agent", "met", "obeyed", "%"), tuple(rows))


def _comfort(runs: Sequence[Run]) -> Table:
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


def _errors(runs: Sequence[Run]) -> Table:
    rows: list[tuple[str, ...]] = []
    heads: tuple[str, ...] = ()
    for run in runs:
        for condition in conditions([run]):
            found = errors(run.only(condition))
            heads = tuple(f"{n.replace('_', ' ')} {UNITS.get(n, '% wrong')}" for n in found) or heads
            rows.append((
                run.name, condition, *(f"{v:.3f}" if k in UNITS else f"{100 * v:.2f}" for k, v in found.items())
            ))  # fmt: skip
    text = "What the affordances were off by while driving: share of wrong frames, or mean absolute error."
    return Table("Affordances while driving", text, ("agent", "condition", *heads), tuple(rows))


@dataclass(frozen=True)
class Failure:
    """An episode that missed its goal or broke a rule. before: for each infraction what was wrong in the seconds
    before it."""

    run: str
    one: Driven
    before: tuple[str, ...]


def failures(runs: Sequence[Run]) -> list[Failure]:
    """All of them, in the suites' order."""
    return [
        Failure(run.name, one, tuple(_before(one, k) for k in range(len(one.result.infractions))))
        for run in runs
        for one in run.driven
        if one.result.outcome is not Outcome.SUCCESS or any(i.at_fault for i in one.result.infractions)
    ]


def _before(one: Driven, k: int) -> str:
    """The affordances that were off in the seconds before infraction k."""
    found = {n.split("/")[2]: v for n, v in one.figures.items() if n.startswith(f"before/{k}/") and v is not None}
    limits = {"vehicle_distance": 3.0, "relative_angle": 0.1, "center_distance": 0.3}
    wrong = [f"{n.replace('_', ' ')} {v:.2f} {UNITS[n]}" for n, v in found.items() if n in UNITS and v > limits[n]]
    wrong += [f"{n.replace('_', ' ')} {100 * v:.0f} %" for n, v in found.items() if n not in UNITS and v > 0.2]
    return ", ".join(wrong) or "nothing"


def report_text(runs: Sequence[Run]) -> str:
    """The report as Markdown."""
    parts = ["# Benchmark", ""]
    for table in tables(runs):
        parts += [f"## {table.title}", "", table.text, "", "| " + " | ".join(table.head) + " |"]
        parts += ["|" + "---|" * len(table.head), *("| " + " | ".join(row) + " |" for row in table.rows), ""]
    parts += ["## Failures", "", f"{len(failures(runs))} episodes missed their goal or broke a rule.", ""]
    parts += ["| agent | episode | outcome | infractions | wrong in the 3 s before |", "|---|---|---|---|---|"]
    for one in failures(runs):
        broken = ", ".join(f"{i.kind.value} at {i.time:.1f} s" for i in one.one.result.infractions)
        before = "; ".join(one.before[:3])
        parts.append(f"| {one.run} | {one.one.trial.key} | {one.one.result.outcome.value} | {broken} | {before} |")
    return "\n".join(parts) + "\n"
