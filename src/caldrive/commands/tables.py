"""Results as tables for people."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from rich.box import SIMPLE_HEAD
from rich.console import Group
from rich.markup import escape
from rich.table import Table
from rich.text import Text

from caldrive.affordances import BY_NAME, SPECS, AffordanceSpec
from caldrive.results import EpisodeResult, Outcome, mean_speed

if TYPE_CHECKING:  # a table waits for neither torch nor SUMO
    from caldrive.benchmark.metrics import Cell
    from caldrive.benchmark.suites import TrialResult
    from caldrive.carla_bridge.client.checklist import Check
    from caldrive.driving.drive import DriveReport
    from caldrive.driving.speed import WorldTiming
    from caldrive.perception.evaluation.report import Report
    from caldrive.recordings.check import RecordingSummary
    from caldrive.search.run import SearchResult
    from caldrive.tune.auto import TuningResult
    from caldrive.tune.config import TuneConfig


def _row(k: int, result: EpisodeResult) -> list[str | Text]:
    """An episode's row of `drive_table`."""
    counts = Counter(infraction.kind.value for infraction in result.infractions)
    infractions = ", ".join(f"{n} × {kind}" for kind, n in counts.items())
    reached = result.outcome is Outcome.SUCCESS
    return [
        str(k),
        result.scenario.task,
        Text(result.outcome.name.lower(), "green" if reached else "yellow"),
        f"{result.duration:.0f} / {result.scenario.time_limit:.0f} s",
        f"{result.distance:.0f} / {result.route_length:.0f} m",
        f"{mean_speed(result):.1f}",
        Text(infractions or "none", "red" if infractions else "green"),
    ]


def drive_table(report: DriveReport) -> Group:
    """One row for each episode, and where everything is."""
    table = Table("episode", "task", "outcome", "time", "driven", "km/h", "infractions", box=SIMPLE_HEAD)
    for column in table.columns[:-1]:
        column.no_wrap = True
    for k, result in enumerate(report.results):
        table.add_row(*_row(k, result))
    reached = sum(result.outcome is Outcome.SUCCESS for result in report.results)
    infractions = sum(len(result.infractions) for result in report.results)
    summary = f"{reached} of {len(report.results)} reached the goal in time; infractions: {infractions or 'none'}"
    made = {"video": report.video, "recording": report.recording}
    lines = [Text(f"{name}: {path}") for name, path in made.items() if path]
    return Group(table, Text(summary), *lines, Text(f"episodes: {report.files[0].parent}"))


def world_table(speed: WorldTiming, ratios: Mapping[str, float]) -> Group:
    """Where a step's time goes, the longest first. ratios: how many times as fast as before, by part."""
    columns = ("part of a step", "median ms", "share", *(("times as fast",) if ratios else ()))
    table = Table(*columns, box=SIMPLE_HEAD)
    for column in table.columns[1:]:
        column.justify = "right"

    def ratio(name: str) -> tuple[str, ...]:
        return (f"{ratios[name]:.2f}" if name in ratios else "",) if ratios else ()

    for name, value in sorted(speed.parts_ms.items(), key=lambda item: -item[1]):
        table.add_row(name, f"{value:.3f}", f"{100 * value / speed.median_ms:.0f} %", *ratio(name))
    table.add_row("whole step", f"{speed.median_ms:.3f}", "", *ratio("whole step"), style="bold")
    first = f"first frame after {speed.first_frame:.2f} s, and {speed.imports:.2f} s to load the libraries before it"
    rate = f"{speed.steps_per_second:.0f} camera steps a second on {speed.processor}"
    return Group(table, Text(rate), Text(first), Text(f"{speed.memory_mb:.0f} MB of memory at most"))


def counts_table(folder: Path, counts: dict[str, dict[str, int]]) -> Group:
    """How many frames of a recording carry which label."""
    table = Table("label", "frames", box=SIMPLE_HEAD)
    for name, values in counts.items():
        shown = ", ".join(f"{value}: {n}" for value, n in values.items())
        table.add_row(name.replace("_", " "), shown or "none")
    return Group(table, Text(f"recorded: {folder}; train on it: caldrive train --data {folder}"))


def recording_table(summary: RecordingSummary, picture: Path | None) -> Group:
    """What a recording holds, and its damaged files and missing episodes."""
    weathers = sorted(summary.weathers.items(), key=lambda item: int(item[0]))
    by_weather = ", ".join(f"{n} in weather {weather}" for weather, n in weathers)
    shown: list[Table | Text] = [Text(f"{summary.episodes} episodes: {by_weather or 'none is sound'}")]
    if picture is not None:
        table = Table("label", "value", "frames", "share", box=SIMPLE_HEAD)
        for name, values in summary.counts.items():
            for value, n in values.items():
                table.add_row(name.replace("_", " "), value, str(n), f"{100 * n / summary.frames:.1f} %")
        size = Text(f"{summary.frames} frames, {summary.minutes:.0f} minutes")
        shown += [size, table, Text(f"histograms: {picture}")]
    shown += [Text(sentence, "red") for sentence in summary.damaged] or [Text("no damaged file", "green")]
    if summary.missing:
        shown.append(Text(f"{summary.missing} more were asked for: type `caldrive collect` as before", "yellow"))
    return Group(*shown)


def _cell_text(cell: Cell) -> Text:
    """Success with its interval, and what the paper's CAL reached."""
    from caldrive.benchmark.published import success

    (low, high), published = cell.interval, success("CAL", cell.condition, cell.task)
    text = f"{cell.successes}/{cell.episodes}  {cell.percent:.0f} % ({low:.0f}-{high:.0f})"
    return Text(text if published is None else f"{text}  paper {published}", no_wrap=True)


def success_table(results: Sequence[TrialResult]) -> Table:
    """Success in each cell, percent with the 95 % interval, beside what the paper's CAL reached."""
    from caldrive.benchmark.metrics import cells

    by_place = {(cell.condition, cell.task): cell for cell in cells(results)}
    conditions, tasks = (list(dict.fromkeys(place[k] for place in by_place)) for k in (0, 1))
    table = Table("success", *map(escape, conditions), box=SIMPLE_HEAD)
    for task in tasks:
        row = [by_place.get((condition, task)) for condition in conditions]
        table.add_row(Text(task), *(_cell_text(cell) if cell else "" for cell in row))
    return table


def infraction_table(results: Sequence[TrialResult]) -> Table:
    """Kilometres between infractions of each kind, by condition."""
    from caldrive.benchmark.metrics import by_condition, infraction_rates

    columns = {condition: infraction_rates(members) for condition, members in by_condition(results).items()}
    table = Table("km between", *map(escape, columns), box=SIMPLE_HEAD)
    for row in zip(*columns.values(), strict=True):
        table.add_row(row[0].kind.value, *(f"{rate.km_between} ({rate.count})" for rate in row))
    return table


def benchmark_table(results: Sequence[TrialResult], out: str) -> Group:
    """Both, and where the results are."""
    return Group(success_table(results), infraction_table(results), Text(f"results: {out}"))


def _head(spec: AffordanceSpec) -> str:
    words = spec.title.replace(" ", "\n")
    return f"{words}\nIoU %" if spec.discrete else f"{words}\n{spec.unit}"


def _figure(value: float | None, scale: float = 1.0) -> str:
    """Three digits, or a dash where there is no figure."""
    return "-" if value is None else f"{value * scale:.3g}"


def _figures(figures: Mapping[str, float | None]) -> list[str]:
    """One cell for each affordance, in percent or in SI units."""
    return [_figure(figures.get(spec.metric), 100 if spec.discrete else 1) for spec in SPECS]


def _scaled(figures: Mapping[str, float | None]) -> list[str]:
    """Errors of the continuous affordances in units of their scale, as the supplement prints them."""
    return ["" if spec.discrete else _figure(figures.get(spec.metric), 1 / spec.scale) for spec in SPECS]


def evaluation_table(report: Report, precision: str) -> Group:
    """Mean IoU and MAE over all frames beside the paper's, then by command, weather and so on; confusions."""
    from caldrive.perception.evaluation.report import published_figures

    table = Table("", *map(_head, SPECS), box=SIMPLE_HEAD)
    for column in table.columns:
        column.no_wrap = True
    rows: dict[str, Mapping[str, float | None]] = {"all frames": report.overall}
    rows["the paper, in CARLA"] = published_figures()
    rows |= {f"{kind} {value}": row for kind, values in report.groups.items() for value, row in values.items()}
    for name, figures in rows.items():
        table.add_row(name, *_figures(figures))
    table.add_row("all, scaled", *_scaled(report.overall))
    table.add_row("the paper, scaled", *_scaled(published_figures()))
    head = Text(f"{report.frames} frames, in {precision}")
    return Group(head, table, *(_confusion(name, report) for name in report.confusion))


def _confusion(name: str, report: Report) -> Table:
    """How many of each class were seen as each, and each class's IoU; a dash for one that never occurred."""
    classes = BY_NAME[name].classes
    table = Table(f"{BY_NAME[name].title}, true", *(f"seen as {c}" for c in classes), "IoU %", box=SIMPLE_HEAD)
    for c, row, iou in zip(classes, report.confusion[name], report.class_iou[name], strict=True):
        table.add_row(str(c), *map(str, row), _figure(iou, 100))
    return table


def search_table(findings: SearchResult, page: Path) -> Group:
    """The best block of each task with its score, and where everything is."""
    from caldrive.search.report import change, printed

    columns = ("task", "type", "nodes", "dropout", "frames", "apart", "score", "without history", "trials", "pruned")
    table = Table(*columns, box=SIMPLE_HEAD)
    for task in findings.tasks:
        best, single = task.best, task.best_of_kind(temporal=False)
        block = best.block
        gain = "-" if single is None else f"{printed(task.task, single.mean)} ({change(single.mean, best.mean)})"
        table.add_row(
            BY_NAME[task.task].title, block.layer, str(block.nodes), f"{block.dropout:.2f}", str(block.length),
            str(block.dilation), f"{printed(task.task, best.mean)} ± {printed(task.task, best.spread)}", gain,
            str(len(task.trials)), str(sum(trial.pruned for trial in task.trials)),
        )  # fmt: skip
    drive = Text(f"drive: caldrive drive --model {findings.networks['groups'].path}")
    return Group(table, Text(f"report: {page}"), drive)


def tuning_table(findings: TuningResult, config: TuneConfig, page: Path, controller: Path) -> Group:
    """Costs before and after, the constants that changed, and where everything is."""
    from caldrive.tune.report import HEADS, constant_rows, cost_rows

    costs, changes = Table(*HEADS, box=SIMPLE_HEAD), Table("constant", "before", "after", box=SIMPLE_HEAD)
    for row in cost_rows(findings, config):
        costs.add_row(*row)
    for name, old, new in constant_rows(findings):
        changes.add_row(name, old, new)
    drive = Text(f"drive: caldrive drive --controller {controller}")
    return Group(costs, changes, Text(f"report: {page}"), drive)


def checks_table(checks: Sequence[Check]) -> Table:
    """One row for each thing that was looked at."""
    table = Table("what", "", "found", box=SIMPLE_HEAD)
    for check in checks:
        table.add_row(check.what, Text("ok" if check.ok else "not", "green" if check.ok else "red"), Text(check.found))
    return table
