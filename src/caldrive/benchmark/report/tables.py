"""The report's tables as rows of text: every number of the paper's tables beside ours."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path

from caldrive.affordances import BY_NAME, SPECS, AffordanceSpec
from caldrive.benchmark.failure_causes import common_places
from caldrive.benchmark.metrics import (
    Cell,
    mean_comfort,
    mean_errors,
    paired,
    succeeded,
)
from caldrive.benchmark.published import COMFORT, SYSTEMS, success
from caldrive.benchmark.report.infraction_tables import (
    infractions_table,
    of_tasks,
    published_heads,
    red_lights_table,
    speeding_table,
    touches_table,
)
from caldrive.benchmark.report.runs import BenchmarkRun, Table, cells_by_place, conditions, suites
from caldrive.benchmark.suites import TrialResult

SUBJECT, ALL = "cal", "all"  # whose comparison with each other agent is asked for; every condition or task
STATIC = "navigation"  # the task whose comfort the paper gives
COMFORT_HEADS = {
    "center_distance": "centre distance, median m",
    "jerk": "jerk m/s³", "lateral_straight": "lateral, straight m/s³", "lateral_turn": "lateral, turns m/s³",
    "jerk_frame": "a frame m/s²", "lateral_straight_frame": "lateral, straight, a frame m/s²",
    "lateral_turn_frame": "lateral, turns, a frame m/s²", "comfortable": "in nuPlan's bounds %",
}  # fmt: skip


def tables(runs: Sequence[BenchmarkRun]) -> list[Table]:
    """All tables of the report: the runs, their success, and of the others those that are not empty."""
    others = [
        _paired(runs), infractions_table(runs), touches_table(runs), red_lights_table(runs), speeding_table(runs),
        _comfort(runs), _affordance_errors(runs), _failure_causes(runs), _blame(runs),
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
        said += f"{counted(faults, 'infraction')} of its own fault in {km:.0f} km"
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
        published = [success(system, condition, task, suites(runs)) for system in SYSTEMS]
        rows.append((condition, task, *ours, *("" if value is None else str(value) for value in published)))
    heads = [f"{run.name} {metric}" for run in runs for metric in ("%", "clean %", "route %", "score")]
    text = (
        "Percent of the episodes that reached their goal in time, with Wilson's 95 % interval, and with the standard "
        "deviation where a suite drives several times; percent that did so "
        "clean, without an infraction of their own fault; share of the routes covered; driving score of Leaderboard "
        "2.1. The published systems drove in CARLA: the paper's table 1, and in NoCrash CAL as Codevilla et al. (2019) "
        "drove it."
    )
    head = ("condition", "task", *heads, *published_heads())
    return Table(title="Success", text=text, head=head, rows=tuple(rows))


def _cell_texts(cell: Cell | None) -> tuple[str, str, str, str]:
    """Success, clean, route and score of a cell; empty where a run has not driven it."""
    if cell is None:
        return "", "", "", ""
    low, high = cell.interval
    deviation = "" if cell.deviation is None else f" ± {cell.deviation:.0f}"
    return (
        f"{cell.percent:.0f}{deviation} ({low:.0f}-{high:.0f}, {cell.successes} of {cell.episodes})",
        f"{100 * cell.clean / cell.episodes:.0f}",
        f"{100 * cell.completion:.0f}",
        f"{cell.score:.0f}",
    )


def _paired(runs: Sequence[BenchmarkRun]) -> Table:
    """CAL, or without it the first run, beside each of the others, on the episodes that both drove."""
    first = next((run for run in runs if run.name == SUBJECT), runs[0])
    places = [(ALL, ALL), *dict.fromkeys(key[1:] for key in cells_by_place(runs))]
    rows = []
    for other in runs:
        for condition, task in places if other is not first else ():
            pair = paired(_in_cell(first, condition, task), _in_cell(other, condition, task))
            if pair.episodes:
                counts = (pair.both, pair.first_alone, pair.second_alone, pair.neither)
                rows.append((condition, task, other.name, *map(str, counts), f"{pair.p_value:.2g}"))
    text = (
        f"Goals that {first.name} and another agent reached in time in the same episodes, and McNemar's exact test: "
        "how likely a difference as large would be if both were as good."
    )
    head = ("condition", "task", "other", "both", f"{first.name} alone", "other alone", "neither", "p")
    return Table(title="Paired comparison", text=text, head=head, rows=tuple(rows))


def _in_cell(run: BenchmarkRun, condition: str, task: str) -> list[TrialResult]:
    return list(run.results) if condition == ALL else of_tasks(run.of_condition(condition), task)


def _comfort(runs: Sequence[BenchmarkRun]) -> Table:
    rows = []
    for run in runs:
        groups = {"all": list(run.results)} | {name: run.of_condition(name) for name in conditions([run])}
        if any(of_tasks(run.results, STATIC)):
            groups = {f"{STATIC}, all conditions": of_tasks(run.results, STATIC)} | groups
        for name, results in groups.items():
            rows.append((run.name, name, *_comfort_texts(mean_comfort(results))))
    for system, figures in COMFORT.items():
        rows.append((f"{system} (paper)", f"{STATIC}, all conditions", *_comfort_texts(figures)))
    text = (
        "Median distance to the centre line and RMS jerk (supplement 3.2, over static navigation in all conditions), "
        "the change of acceleration from frame to frame, which has the scale of the paper's figures, and the share of "
        "time in comfort."
    )
    head = ("agent", "where", *COMFORT_HEADS.values())
    return Table(title="Driving behaviour", text=text, head=head, rows=tuple(rows))


def _comfort_texts(means: Mapping[str, float]) -> list[str]:
    """One for each of COMFORT_HEADS, empty where it is not known."""
    texts = {name: f"{100 * mean:.1f}" if name == "comfortable" else f"{mean:.3f}" for name, mean in means.items()}
    return [texts.get(name, "") for name in COMFORT_HEADS]


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


def _blame(runs: Sequence[BenchmarkRun]) -> Table:
    rows = []
    for run in runs:
        known = [failure.explanation for failure in run.failures if failure.explanation.blame]
        counts = Counter(why.counted for why in known)
        blamed = Counter(name for why in known for name in why.blamed)
        alone = Counter(name for why in known for name in why.alone)
        titles = [spec.title for spec in SPECS]
        for name in dict.fromkeys([*titles, *counts]) if known else ():
            more = (str(blamed[name]), str(alone[name])) if name in titles else ("", "")
            rows.append((run.name, name, f"{counts[name]} of {len(known)}", *more))
    text = (
        "What failures come from, each counted once: an affordance alone is to blame where its truth rescues the "
        "episode, and no other's does. Beside that how many its truth rescues in all, and how many go wrong when it "
        "alone is seen and all others are told."
    )
    head = ("agent", "to blame", "failures", "rescued by its truth", "fail with it alone seen")
    return Table(title="Blame", text=text, head=head, rows=tuple(rows))
