"""The report's tables of what went wrong on the road: infractions, touches, red lights and speeding."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from caldrive.benchmark.metrics import InfractionRate, infraction_rates, red_light_counts, speeding, touch_rates
from caldrive.benchmark.published import SYSTEMS, km_between
from caldrive.benchmark.report.runs import BenchmarkRun, Table, conditions
from caldrive.benchmark.suites import TrialResult
from caldrive.driving.speeding import BRAKING, TOLERANCE
from caldrive.results import InfractionKind

DYNAMIC, ALL = "navigation-dynamic", "all"  # tasks whose infractions are counted together
# What CARLA's benchmarks do not count, named only where there are any.
OURS_ALONE = (InfractionKind.YELLOW_LIGHT, InfractionKind.SPEEDING)


def infractions_table(runs: Sequence[BenchmarkRun]) -> Table:
    """Kilometres between infractions, beside the paper's (table 2)."""
    rows = []
    for condition in conditions(runs):
        for tasks in (DYNAMIC, ALL):
            rates = [infraction_rates(of_tasks(run.of_condition(condition), tasks)) for run in runs]
            for rates_of_kind in _rows_of_kinds(rates):
                kind = rates_of_kind[0].kind
                published = [km_between(system, condition, kind) if tasks == DYNAMIC else "" for system in SYSTEMS]
                rows.append((condition, tasks, kind.value, *_rate_texts(rates_of_kind), *published))
    text = (
        "Kilometres between two infractions and how many there were, whoever's fault they were, by the rules "
        f"{' and '.join(sorted({result.episode.rules for run in runs for result in run.results}))} (docs/protocols); > "
        "where there was none in so many kilometres; and how many were the agent's fault. The paper counts "
        "infractions in the task navigation-dynamic only."
    )
    head = ("condition", "tasks", "infraction", *_rate_heads(runs), *published_heads())
    return Table(title="Infractions", text=text, head=head, rows=tuple(rows))


def touches_table(runs: Sequence[BenchmarkRun]) -> Table:
    """Kilometres between touches, of the runs that note them."""
    runs = [run for run in runs if run.notes_touches]
    rows = []
    for condition in conditions(runs):
        rates = [touch_rates(run.of_condition(condition)) for run in runs]
        for rates_of_kind in _rows_of_kinds(rates):
            rows.append((condition, rates_of_kind[0].kind.value, *_rate_texts(rates_of_kind)))
    text = (
        "Everything that was touched, once a contact, however soft, in all tasks: kilometres between two, and how many."
    )
    return Table(title="Touches", text=text, head=("condition", "what", *_rate_heads(runs)), rows=tuple(rows))


def _rows_of_kinds(rates: Sequence[Sequence[InfractionRate]]) -> Iterator[tuple[InfractionRate, ...]]:
    """For each kind the rates of all runs, where somebody drove."""
    for of_kind in zip(*rates, strict=True):
        if any(rate.km for rate in of_kind) and (of_kind[0].kind not in OURS_ALONE or any(r.count for r in of_kind)):
            yield of_kind


def _rate_texts(rates: Sequence[InfractionRate]) -> list[str]:
    return [text for rate in rates for text in (f"{rate.km_between} ({rate.count})", str(rate.own))]


def _rate_heads(runs: Sequence[BenchmarkRun]) -> list[str]:
    return [head for run in runs for head in (f"{run.name} km", f"{run.name} own fault")]


def speeding_table(runs: Sequence[BenchmarkRun]) -> Table:
    """How much too fast those were who are told to obey the signs."""
    rows = []
    for run in runs:
        share, worst = speeding(run.results)
        if run.description["cap"] is None:
            rows.append((run.name, f"{100 * share:.2f}", f"{worst:.1f}"))
    text = (
        "Agents that are told to obey the signs: share of the time faster than allowed by more than "
        f"{TOLERANCE:g} km/h, and the largest excess; after a lower sign they may slow down at {BRAKING:g} m/s²."
    )
    return Table(title="Speeding", text=text, head=("agent", "% of time", "at most km/h"), rows=tuple(rows))


def of_tasks(results: Sequence[TrialResult], tasks: str) -> list[TrialResult]:
    """The results of a task, or of all."""
    return [result for result in results if tasks in (ALL, result.trial.scenario.task)]


def red_lights_table(runs: Sequence[BenchmarkRun]) -> Table:
    """Red lights met and obeyed."""
    rows = []
    for condition in conditions(runs):
        for run in runs:
            met, ran = red_light_counts(run.of_condition(condition))
            share = f"{100 * (met - ran) / met:.1f}" if met else ""
            rows.append((condition, run.name, str(met), str(met - ran), share))
    text = "Red lights that an agent stopped for or ran; those that turned green before it stood do not count."
    return Table(title="Red lights", text=text, head=("condition", "agent", "met", "obeyed", "%"), rows=tuple(rows))


def published_heads() -> tuple[str, ...]:
    """Of the columns beside ours."""
    return tuple(f"{system} (published)" for system in SYSTEMS)
