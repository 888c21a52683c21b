"""What recordings hold and networks see, as tables for people; apart from the others because it needs torch."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from rich.box import SIMPLE_HEAD
from rich.console import Group
from rich.table import Table
from rich.text import Text

from caldrive.perception.recordings import Recording
from caldrive.perception.report import PAPER, Report
from caldrive.perception.specs import SPECS

FIGURES = {  # the heads of the columns, the metric in each, and the factor to its unit
    "hazard\nIoU %": ("hazard_stop/iou", 100.0),
    "red\nIoU %": ("red_light/iou", 100.0),
    "sign\nIoU %": ("speed_sign/iou", 100.0),
    "ahead\nm": ("vehicle_distance/mae", 1.0),
    "angle\nrad": ("relative_angle/mae", 1.0),
    "centre\nm": ("center_distance/mae", 1.0),
}
SCALES = {f"{spec.name}/mae": spec.scale for spec in SPECS}


def recording_table(found: Recording, picture: Path | None) -> Group:
    """What a recording holds, and its damaged files and missing episodes."""
    weathers = ", ".join(f"{n} in weather {weather}" for weather, n in sorted(found.weathers.items(), key=_number))
    shown: list[Table | Text] = [Text(f"{found.episodes} episodes: {weathers or 'none is sound'}")]
    if picture is not None:
        table = Table("label", "value", "frames", "share", box=SIMPLE_HEAD)
        for name, values in found.counts.items():
            for value, n in values.items():
                table.add_row(name.replace("_", " "), value, str(n), f"{100 * n / found.frames:.1f} %")
        shown += [Text(f"{found.frames} frames, {found.minutes:.0f} minutes"), table, Text(f"histograms: {picture}")]
    damaged = [Text(sentence, "red") for sentence in found.damaged] or [Text("no damaged file", "green")]
    left = [Text(f"{found.missing} more were asked for: type `caldrive collect` as before", "yellow")]
    return Group(*shown, *damaged, *(left if found.missing else []))


def _number(item: tuple[str, int]) -> int:
    return int(item[0])


def _papers(metric: str) -> float:
    """The paper's figure, in SI units."""
    return PAPER[metric] if metric in PAPER else PAPER[f"{metric}_scaled"] * SCALES[metric]


def _scaled(metric: str, figures: Mapping[str, float]) -> str:
    """A continuous affordance's figure in units of its scale, as the supplement prints it."""
    return f"{figures[metric] / SCALES[metric]:.3g}" if metric.endswith("/mae") else ""


def evaluation_table(found: Report, precision: str) -> Group:
    """Mean IoU and MAE over all frames, as the paper has them, and by command, weather and so on; confusions."""
    paper = {name: _papers(name) for name, _ in FIGURES.values()}
    table = Table("", *FIGURES, box=SIMPLE_HEAD)
    for column in table.columns:
        column.no_wrap = True
    rows = {"all frames": found.overall, "the paper, in CARLA": paper}
    rows |= {f"{kind} {value}": figures for kind, values in found.groups.items() for value, figures in values.items()}
    for name, figures in rows.items():
        table.add_row(name, *(f"{factor * figures[metric]:.3g}" for metric, factor in FIGURES.values()))
    for name, figures in (("all, scaled", found.overall), ("the paper, scaled", paper)):
        table.add_row(name, *(_scaled(metric, figures) for metric, _ in FIGURES.values()))
    head = Text(f"{found.frames} frames, in {precision}")
    return Group(head, table, *(_confusion(n, c) for n, c in found.confusion.items()))


def _confusion(name: str, counts: list[list[int]]) -> Table:
    classes = next(spec.classes for spec in SPECS if spec.name == name)
    table = Table(f"{name.replace('_', ' ')}, true", *(f"seen as {c}" for c in classes), box=SIMPLE_HEAD)
    for c, row in zip(classes, counts, strict=True):
        table.add_row(str(c), *map(str, row))
    return table
