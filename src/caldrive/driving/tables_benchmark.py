"""A suite's results as tables for people."""

from __future__ import annotations

from collections.abc import Sequence

from rich.box import SIMPLE_HEAD
from rich.console import Group
from rich.markup import escape
from rich.table import Table
from rich.text import Text

from caldrive.driving.measures import Cell, cells, rates
from caldrive.driving.published import success
from caldrive.driving.suites import Driven


def _published(cell: Cell) -> str:
    found = success("CAL", cell.condition, cell.task)
    return "" if found is None else f"  paper {found}"


def _text(cell: Cell) -> Text:
    low, high = cell.interval
    text = f"{cell.successes}/{cell.episodes}  {cell.percent:.0f} % ({low:.0f}-{high:.0f}){_published(cell)}"
    return Text(text, no_wrap=True)


def success_table(driven: Sequence[Driven]) -> Table:
    """Success in each cell, percent with the 95 % interval, beside what the paper's CAL reached."""
    found = {(cell.condition, cell.task): cell for cell in cells(driven)}
    conditions, tasks = (list(dict.fromkeys(key[k] for key in found)) for k in (0, 1))
    table = Table("success", *map(escape, conditions), box=SIMPLE_HEAD)
    for task in tasks:
        row = [found.get((condition, task)) for condition in conditions]
        table.add_row(Text(task), *(_text(cell) if cell else "" for cell in row))
    return table


def infraction_table(driven: Sequence[Driven]) -> Table:
    """Kilometres between infractions of each kind, by condition."""
    conditions = list(dict.fromkeys(one.trial.condition for one in driven))
    table = Table("km between", *map(escape, conditions), box=SIMPLE_HEAD)
    columns = [rates([one for one in driven if one.trial.condition == name]) for name in conditions]
    for row in zip(*columns, strict=True):
        table.add_row(row[0].kind.value, *(f"{rate.km_between} ({rate.count})" for rate in row))
    return table


def benchmark_table(driven: Sequence[Driven], out: str) -> Group:
    """Both, and where the results are."""
    return Group(success_table(driven), infraction_table(driven), Text(f"results: {out}"))
