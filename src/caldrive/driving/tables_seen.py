"""What recordings hold and networks see, as tables for people; apart from the others because it needs torch."""

from __future__ import annotations

from pathlib import Path

from rich.box import SIMPLE_HEAD
from rich.console import Group
from rich.table import Table
from rich.text import Text

from caldrive.perception.recordings import Recording
from caldrive.perception.report import PAPER, Report
from caldrive.perception.specs import SPECS


def recording_table(folder: Path, found: Recording, picture: Path) -> Group:
    """What a recording holds, and its damaged files."""
    weathers = ", ".join(f"weather {weather}: {n}" for weather, n in sorted(found.weathers.items()))
    said = f"{found.episodes} episodes ({weathers}), {found.frames} frames, {found.minutes:.0f} minutes"
    table = Table("label", "value", "frames", "share", box=SIMPLE_HEAD)
    for name, values in found.counts.items():
        for value, n in values.items():
            table.add_row(name.replace("_", " "), value, str(n), f"{100 * n / found.frames:.1f} %")
    damaged = [Text(sentence, "red") for sentence in found.damaged] or [Text("no damaged file", "green")]
    return Group(Text(said), table, *damaged, Text(f"histograms: {picture}"))


def _figure(name: str, value: float) -> str:
    return f"{100 * value:.1f} %" if name.endswith("/iou") else f"{value:.3g}"


def evaluation_table(found: Report) -> Group:
    """Every figure over all frames, beside the paper's, and by command, weather and town; then the confusions."""
    table = Table("figure", "all", "paper", box=SIMPLE_HEAD)
    columns = [(kind, value) for kind, values in found.groups.items() for value in values]
    for kind, value in columns:
        table.add_column(f"{kind} {value}")
    for name, overall in found.overall.items():
        paper = _figure(name, PAPER[name]) if name in PAPER else ""
        parts = [_figure(name, found.groups[kind][value][name]) for kind, value in columns]
        table.add_row(name.replace("_", " "), _figure(name, overall), paper, *parts)
    return Group(Text(f"{found.frames} frames"), table, *(_confusion(n, c) for n, c in found.confusion.items()))


def _confusion(name: str, counts: list[list[int]]) -> Table:
    classes = next(spec.classes for spec in SPECS if spec.name == name)
    table = Table(f"{name.replace('_', ' ')}, true", *(f"seen as {c}" for c in classes), box=SIMPLE_HEAD)
    for c, row in zip(classes, counts, strict=True):
        table.add_row(str(c), *map(str, row))
    return table
