"""Prints the tables of README.md and docs/results.md, from the lines that are kept in docs/results.

python -m scripts.result_tables [unseen paper ...] [--results docs/results]
"""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from statistics import fmean

from caldrive.benchmark.metrics import Cell, cells, red_light_counts, speeding, touch_rates, wilson
from caldrive.benchmark.published import SYSTEMS, success
from caldrive.benchmark.report.runs import BenchmarkRun, load_run, suites
from caldrive.benchmark.report.tables import STATIC, tables
from caldrive.benchmark.suites import CONDITIONS, DENSITIES, TrialResult
from caldrive.driving.tasks import TASKS
from caldrive.results import InfractionKind

RESULTS = Path(__file__).parents[1] / "docs" / "results"
Rows = Iterator[Sequence[str]]
TOUCHED = (InfractionKind.COLLISION_PERSON, InfractionKind.COLLISION_CAR, InfractionKind.COLLISION_OBJECT)


def runs_of(folder: Path) -> dict[str, BenchmarkRun]:
    """The kept runs of a suite by the names of their folders."""
    return {path.parent.name: load_run(path.parent) for path in sorted(folder.glob("*/run.json"))}


def unseen(folder: Path) -> Rows:
    """Success in generated towns: a row for each driver, a column for each task, with Wilson's interval."""
    runs = runs_of(folder)
    tasks = list(dict.fromkeys(cell.task for run in runs.values() for cell in cells(run.results)))
    yield "driver", *tasks, "km", "touched: people, cars, objects", "red lights run"
    for name, run in runs.items():
        percents = {cell.task: cell for cell in cells(run.results)}
        touched = {rate.kind: rate for rate in touch_rates(run.results)}
        met, ran = red_light_counts(run.results)
        yield (
            name, *(_success(percents.get(task)) for task in tasks),
            f"{touched[TOUCHED[0]].km:.0f}",
            ", ".join(str(touched[kind].count) for kind in TOUCHED), f"{ran} of {met}",
        )  # fmt: skip


def _success(cell: Cell | None) -> str:
    """Empty for what was not driven."""
    if cell is None:
        return ""
    low, high = cell.interval
    return f"{cell.percent:.0f} ({low:.0f}-{high:.0f})"


def paper(folder: Path) -> Rows:
    """The paper's table 1: ours in CARLA-like towns, and its four systems in CARLA."""
    yield from _beside_published(folder, TASKS, SYSTEMS)


def nocrash(folder: Path) -> Rows:
    """NoCrash: mean and deviation over three seeds, and the published CAL."""
    yield from _beside_published(folder, tuple(DENSITIES), ("CAL",))


def traffic_school(folder: Path) -> Rows:
    """Likewise NoCrash in which lights, the opposite lane and the sidewalk count; nobody says how CAL drives it."""
    yield from _beside_published(folder, tuple(DENSITIES), ())


def _beside_published(folder: Path, tasks: Sequence[str], systems: Sequence[str]) -> Rows:
    runs = runs_of(folder)
    found = {(name, cell.condition, cell.task): cell for name, run in runs.items() for cell in cells(run.results)}
    of = suites(list(runs.values()))
    yield "", "task", *runs, *(f"{system} (published)" for system in systems)
    for condition in CONDITIONS:
        for task in tasks:
            ours = [found.get((name, condition, task)) for name in runs]
            texts = ["" if cell is None else f"{cell.percent:.0f}{_spread(cell.deviation)}" for cell in ours]
            yield condition, task, *texts, *(_printed(success(system, condition, task, of)) for system in systems)


def _printed(percent: int | None) -> str:
    return "" if percent is None else str(percent)


def _spread(deviation: float | None) -> str:
    return "" if deviation is None else f" ± {deviation:.0f}"


def blind(folder: Path) -> Rows:
    """What each affordance is worth: drivers who know the truth but for something, in each town."""
    yield (
        "driver", "town", "km", "goals %", "km between people touched", "km between cars touched", "of them own fault",
        "objects touched", "red lights run", "% of time too fast",
    )  # fmt: skip
    for name, run in runs_of(folder).items():
        for town, results in _by_town(run.results).items():
            yield name, town, *_blind_row(results)


def _by_town(results: Sequence[TrialResult]) -> dict[str, list[TrialResult]]:
    towns = dict.fromkeys(result.trial.scenario.town for result in results)
    return {town: [result for result in results if result.trial.scenario.town == town] for town in towns}


def _blind_row(results: Sequence[TrialResult]) -> Iterator[str]:
    person, car, thing = (next(rate for rate in touch_rates(results) if rate.kind is kind) for kind in TOUCHED)
    reached = sum(cell.successes for cell in cells(results))
    met, ran = red_light_counts(results)
    share, worst = speeding(results)
    low, high = wilson(reached, len(results))
    yield f"{person.km:.0f}"
    yield f"{100 * reached / len(results):.0f} ({100 * low:.0f}-{100 * high:.0f})"
    yield f"{person.km_between} ({person.count})"
    yield f"{car.km_between} ({car.count})"
    yield f"{car.own}"
    yield f"{thing.count}"
    yield f"{ran} of {met}"
    yield f"{100 * share:.1f}" + (f", at most by {worst:.0f} km/h" if worst else "")


def infractions(folder: Path) -> Rows:
    """The paper's table 2, which is of its last task: kilometres between two infractions, and how many."""
    yield from _of_report(folder, "Infractions", lambda row: row[1] == TASKS[-1])


def behaviour(folder: Path) -> Rows:
    """The supplement's driving behaviour: over static navigation, all conditions pooled."""
    yield from _of_report(folder, "Driving behaviour", lambda row: row[1].startswith(STATIC))


def _of_report(folder: Path, title: str, wanted: Callable[[Sequence[str]], bool]) -> Rows:
    """Some rows of a table of the report, without the column that is the same in all of them."""
    table = next(table for table in tables(list(runs_of(folder).values())) if table.title == title)
    for row in (table.head, *filter(wanted, table.rows)):
        yield [row[0], *row[2:]]


def seeds(folder: Path) -> Rows:
    """Success of the systems that learn from chance: mean and range over their seeds in each condition; and the seed in
    the middle by town01's conditions, which ships."""
    runs, conditions = runs_of(folder), dict[str, None]()
    groups = dict[str, list[str]]()
    for name, run in runs.items():
        conditions |= dict.fromkeys(result.trial.condition for result in run.results)
        if (seed := re.fullmatch(r"(.+)-\d+(-by-the-truth)?", name)) is not None:
            groups.setdefault(f"{seed[1]}{seed[2] or ''}", []).append(name)
    yield "system", "seeds", *conditions, "in the middle"
    for system, names in groups.items():
        shares = [[_percent(runs[name].of_condition(condition)) for name in names] for condition in conditions]
        known = sorted(names, key=lambda name: _percent(_in_town01(runs[name].results)))
        yield system, str(len(names)), *map(_mean_and_range, shares), known[(len(known) - 1) // 2]


def _in_town01(results: Sequence[TrialResult]) -> list[TrialResult]:
    """Those that may choose among networks."""
    return [result for result in results if result.trial.scenario.town == "town01"]


def _percent(results: Sequence[TrialResult]) -> float:
    return 100 * sum(cell.successes for cell in cells(results)) / max(1, len(results))


def _mean_and_range(percents: Sequence[float]) -> str:
    return f"{fmean(percents):.0f} ({min(percents):.0f}-{max(percents):.0f})"


TABLES: dict[str, tuple[str, Callable[[Path], Rows]]] = {  # by name: the suite, and what makes the table
    "unseen": ("unseen", unseen),
    "unseen-wide": ("unseen-wide", unseen),
    "paper": ("corl2017", paper),
    "infractions": ("corl2017", infractions),
    "behaviour": ("corl2017", behaviour),
    "seeds": ("corl2017-once", seeds),
    "nocrash": ("nocrash", nocrash),
    "traffic-school": ("traffic-school", traffic_school),
    "blind": ("dynamic", blind),
}


def markdown(rows: Rows) -> str:
    """A table's text; the first row is its head."""
    head, *others = (list(row) for row in rows)
    return "\n".join(f"| {' | '.join(row)} |" for row in (head, ["---"] * len(head), *others))


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("tables", nargs="*", help=f"some of {', '.join(TABLES)}; all for none")
    parser.add_argument("--results", type=Path, default=RESULTS)
    options = parser.parse_args()
    for name in options.tables or TABLES:
        suite, table = TABLES[name]
        if (folder := options.results / suite).exists():
            print(f"{name}\n\n{markdown(table(folder))}\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
