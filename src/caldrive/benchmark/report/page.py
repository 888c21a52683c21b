"""The report as Markdown, and as one HTML page that fetches nothing: tables that sort, failures that filter, figures
and stills inside."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from pathlib import Path

from caldrive.benchmark.report.failure_cards import failures_section
from caldrive.benchmark.report.figures import errors_figure, speed_figure, success_figure
from caldrive.benchmark.report.maps import maps
from caldrive.benchmark.report.runs import BenchmarkRun, Failure, Table, failures
from caldrive.benchmark.report.tables import counted, headline, tables
from caldrive.formats import markdown_table

PAGE_BYTES = 2_990_000  # that the pictures of failures fill up: a page is to stay below 3 MB
_DATA = Path(__file__).parent
FAILURE_HEAD = ("agent", "episode", "outcome", "how it began", "infractions", "wrong in the 3 s before")


def report_page(runs: Sequence[BenchmarkRun]) -> str:
    """The whole HTML page, with pictures of as many failures as its size allows."""
    first_table, success, *other_tables = tables(runs)
    first_figure, *other_figures = _figures(runs)
    body = [
        _table(first_table), _table(success), first_figure, *map(_table, other_tables), *other_figures,
    ]  # fmt: skip
    bare = _page(runs, [*body, failures_section(runs, 0)])
    return _page(runs, [*body, failures_section(runs, PAGE_BYTES - len(bare.encode()))])


def _page(runs: Sequence[BenchmarkRun], body: Sequence[str]) -> str:
    """A page of some sections."""
    style, script = ((_DATA / name).read_text() for name in ("report.css", "report.js"))
    return (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8"><title>caldrive benchmark</title>'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<style>{style}</style></head><body><main><h1>Benchmark</h1>"
        f'<p class="headline">{escape(headline(runs))}</p>{"".join(body)}</main>'
        f"<script>{script}</script></body></html>\n"
    )


def _figures(runs: Sequence[BenchmarkRun]) -> list[str]:
    """A section for each figure, without those of which nothing is known."""
    figures = {
        "Success, with the paper's systems": success_figure(runs),
        "Where things went wrong": maps(runs),
        "Errors of the affordances over time": errors_figure(runs),
        "Speed over distance": speed_figure(runs),
    }
    return [f"<section><h2>{escape(name)}</h2>{svg}</section>" for name, svg in figures.items() if svg]


def _table(table: Table) -> str:
    head = "".join(f'<th><button type="button">{escape(name)}</button></th>' for name in table.head)
    rows = "".join("<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>" for row in table.rows)
    return (
        f"<section><h2>{escape(table.title)}</h2><p>{escape(table.text)}</p>"
        f'<div class="wide"><table class="sortable"><thead><tr>{head}</tr></thead><tbody>{rows}</tbody></table></div>'
        "</section>"
    )


def report_text(runs: Sequence[BenchmarkRun]) -> str:
    """The report as Markdown."""
    parts, failed = ["# Benchmark", "", headline(runs), ""], failures(runs)
    for table in tables(runs):
        parts += [f"## {table.title}", "", table.text, "", markdown_table(table.head, table.rows), ""]
    whose = "its" if len(failed) == 1 else "their"
    parts += ["## Failures", "", f"{counted(len(failed), 'episode')} missed {whose} goal or broke a rule.", ""]
    head = (*FAILURE_HEAD, "to blame") if any(failure.explanation.blame for failure in failed) else FAILURE_HEAD
    rows = [(*_failure_row(failure), failure.explanation.blame)[: len(head)] for failure in failed]
    parts.append(markdown_table(head, rows))
    return "\n".join(parts) + "\n"


def _failure_row(failure: Failure) -> tuple[str, ...]:
    """One cell for each of FAILURE_HEAD."""
    trial, episode = failure.result.trial, failure.result.episode
    infractions = ", ".join(f"{infraction.kind.value} at {infraction.time:.1f} s" for infraction in episode.infractions)
    errors = "; ".join(failure.errors_before[:3])
    return failure.run, trial.key, episode.outcome.value, str(failure.cause or ""), infractions, errors
