"""Results as tables for people."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

from rich.box import SIMPLE_HEAD
from rich.console import Group
from rich.table import Table
from rich.text import Text

from caldrive.driving.drive import DriveReport
from caldrive.driving.speed import WorldSpeed
from caldrive.driving.trace import mean_speed
from caldrive.results import EpisodeResult, Outcome


def infraction_counts(result: EpisodeResult) -> dict[str, int]:
    """How many of each kind, in the order in which they first happened."""
    return dict(Counter(one.kind.value for one in result.infractions))


def _row(k: int, result: EpisodeResult) -> list[str | Text]:
    broken = ", ".join(f"{n} × {kind}" for kind, n in infraction_counts(result).items())
    reached = result.outcome is Outcome.SUCCESS
    return [
        str(k),
        result.scenario.task,
        Text(result.outcome.name.lower(), "green" if reached else "yellow"),
        f"{result.duration:.0f} / {result.scenario.time_limit:.0f} s",
        f"{result.distance:.0f} / {result.route_length:.0f} m",
        f"{mean_speed(result):.1f}",
        Text(broken or "none", "red" if broken else "green"),
    ]


def drive_table(report: DriveReport) -> Group:
    """One row for each episode, and where everything is."""
    table = Table("episode", "task", "outcome", "time", "driven", "km/h", "infractions", box=SIMPLE_HEAD)
    for column in table.columns[:-1]:
        column.no_wrap = True
    for k, result in enumerate(report.results):
        table.add_row(*_row(k, result))
    reached = sum(result.outcome is Outcome.SUCCESS for result in report.results)
    broken = sum(len(result.infractions) for result in report.results)
    summary = f"{reached} of {len(report.results)} reached the goal in time; infractions: {broken or 'none'}"
    video = [Text(f"video: {report.video}")] if report.video else []
    return Group(table, Text(summary), *video, Text(f"episodes: {report.files[0].parent}"))


def world_table(speed: WorldSpeed) -> Group:
    """Where a step's time goes, the longest first."""
    table = Table("part of a step", "median ms", "share", box=SIMPLE_HEAD)
    for column in table.columns[1:]:
        column.justify = "right"
    for name, value in sorted(speed.parts_ms.items(), key=lambda item: -item[1]):
        table.add_row(name, f"{value:.3f}", f"{100 * value / speed.median_ms:.0f} %")
    table.add_row("whole step", f"{speed.median_ms:.3f}", "", style="bold")
    first = f"first frame after {speed.first_frame:.2f} s, and {speed.imports:.2f} s to load the libraries before it"
    return Group(table, Text(f"{speed.steps_per_second:.0f} camera steps a second"), Text(first))


def counts_table(folder: Path, counts: dict[str, dict[str, int]]) -> Group:
    """How many frames of a recording carry which label."""
    table = Table("label", "frames", box=SIMPLE_HEAD)
    for name, values in counts.items():
        shown = ", ".join(f"{value}: {n}" for value, n in values.items())
        table.add_row(name.replace("_", " "), shown or "none")
    return Group(table, Text(f"recorded: {folder}; train on it: caldrive train --data {folder}"))
