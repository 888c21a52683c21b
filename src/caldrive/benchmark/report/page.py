"""The report as Markdown, and as one HTML page that fetches nothing: tables that sort, failures that filter, figures
and stills inside."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from html import escape
from pathlib import Path

from caldrive.benchmark.artifacts import read_still, still_paths
from caldrive.benchmark.metrics import succeeded
from caldrive.benchmark.report.figures import errors_figure, map_figure, speed_figure, success_figure
from caldrive.benchmark.report.runs import BenchmarkRun, Failure, Table, failures
from caldrive.benchmark.report.tables import counted, headline, tables

_DATA = Path(__file__).parent
MAX_STILLS = 120  # on one page; beyond that it would be long to open and large to keep
FAILURE_HEAD = ("agent", "episode", "outcome", "how it began", "infractions", "wrong in the 3 s before")


def report_page(runs: Sequence[BenchmarkRun]) -> str:
    """The whole HTML page."""
    style, script = ((_DATA / name).read_text() for name in ("report.css", "report.js"))
    first_table, success, *other_tables = tables(runs)
    first_figure, *other_figures = _figures(runs)
    body = [
        _table(first_table), _table(success), first_figure, *map(_table, other_tables), *other_figures, _failures(runs)
    ]  # fmt: skip
    return (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8"><title>caldrive benchmark</title>'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<style>{style}</style></head><body><main><h1>Benchmark</h1>"
        f'<p class="headline">{escape(headline(runs))}</p>{"".join(body)}</main>'
        f"<script>{script}</script></body></html>\n"
    )


def _figures(runs: Sequence[BenchmarkRun]) -> list[str]:
    """A section for each figure, without those of which nothing is known."""
    towns = dict.fromkeys(result.trial.scenario.town for run in runs for result in run.results)
    figures = {
        "Success, with the paper's systems": success_figure(runs),
        "Where rules were broken": "".join(map_figure(runs, town) for town in towns),
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


def _failures(runs: Sequence[BenchmarkRun]) -> str:
    """The section with a card for each failure."""
    failed, folders = failures(runs), {run.name: run.folder for run in runs}
    stills = _chosen_stills(failed, folders)
    cards = [_card(failure, paths) for failure, paths in zip(failed, stills, strict=True)]
    text = (
        f'<p><span id="shown">{len(failed)}</span> of {len(failed)} episodes that missed their goal or broke a rule.'
        f" {sum(map(len, stills))} stills, first of those that broke a rule; the folder of a run has all.</p>"
    )
    menus = f'<p class="menus">{_filters(failed)}</p>'
    return f'<section id="failures"><h2>Failures</h2>{text}{menus}{"".join(cards)}</section>'


def _filters(failed: Sequence[Failure]) -> str:
    """A menu for each property by which failures are filtered."""
    choices = {
        "run": list(dict.fromkeys(failure.run for failure in failed)),
        "condition": list(dict.fromkeys(failure.result.trial.condition for failure in failed)),
        "task": list(dict.fromkeys(failure.result.trial.scenario.task for failure in failed)),
        "kind": [*sorted({kind for failure in failed for kind in _infraction_kinds(failure)}), "goal missed"],
    }
    return "".join(
        f'<label>{name} <select data-filter="{name}"><option value="">all</option>'
        + "".join(f"<option>{escape(value)}</option>" for value in values)
        + "</select></label>"
        for name, values in choices.items()
    )


def _infraction_kinds(failure: Failure) -> set[str]:
    return {infraction.kind.value for infraction in failure.result.episode.infractions}


def _chosen_stills(failed: Sequence[Failure], folders: dict[str, Path]) -> list[Sequence[Path]]:
    """For each failure the stills to show, MAX_STILLS in all: who broke a rule goes before who only took too long."""
    chosen: list[Sequence[Path]] = [()] * len(failed)
    remaining = MAX_STILLS
    for k in sorted(range(len(failed)), key=lambda k: not failed[k].result.episode.infractions):
        chosen[k] = still_paths(folders[failed[k].run], failed[k].result.trial.key)[:remaining]
        remaining -= len(chosen[k])
    return chosen


def _card(failure: Failure, stills: Sequence[Path]) -> str:
    """What is shown of one failure."""
    trial, episode = failure.result.trial, failure.result.episode
    infractions = [
        f"<li>{escape(infraction.kind.value)} at {infraction.time:.1f} s{'' if infraction.at_fault else ', by others'}"
        f"<small>wrong in the 3 s before: {escape(errors)}</small></li>"
        for infraction, errors in zip(episode.infractions, failure.errors_before, strict=True)
    ]
    kinds = sorted(_infraction_kinds(failure)) + ([] if succeeded(failure.result) else ["goal missed"])
    data = {
        "run": failure.run, "condition": trial.condition, "task": trial.scenario.task, "kind": "|".join(kinds)
    }  # fmt: skip
    attributes = "".join(f' data-{name}="{escape(value)}"' for name, value in data.items())
    images = "".join(f'<img alt="still" src="{_data_address(path)}">' for path in stills)
    driven = f"{episode.route_done:.0f} of {episode.route_length:.0f} m in {episode.duration:.0f} s"
    cause = f"<p>{escape(str(failure.cause))}</p>" if failure.cause else ""
    return (
        f'<article class="card"{attributes}><h3>{escape(trial.key)} <em>{escape(failure.run)}</em></h3>'
        f"<p>{escape(episode.outcome.value)}; {driven}</p>{cause}<ol>{''.join(infractions)}</ol>{images}</article>"
    )


def _data_address(path: Path) -> str:
    """A JPEG file inside the page."""
    return f"data:image/jpeg;base64,{base64.b64encode(read_still(path)).decode()}"


def report_text(runs: Sequence[BenchmarkRun]) -> str:
    """The report as Markdown."""
    parts, failed = ["# Benchmark", "", headline(runs), ""], failures(runs)
    for table in tables(runs):
        parts += [f"## {table.title}", "", table.text, "", *_markdown_table(table.head, table.rows), ""]
    whose = "its" if len(failed) == 1 else "their"
    parts += ["## Failures", "", f"{counted(len(failed), 'episode')} missed {whose} goal or broke a rule.", ""]
    parts += _markdown_table(FAILURE_HEAD, [_failure_row(failure) for failure in failed])
    return "\n".join(parts) + "\n"


def _markdown_table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    lines = ("| " + " | ".join(map(_markdown_cell, row)) + " |" for row in (head, *rows))
    return [next(lines), "|" + "---|" * len(head), *lines]


def _markdown_cell(text: str) -> str:
    """A text from a file as one cell: no line may end in it, and no other cell begin."""
    return " ".join(text.splitlines()).replace("|", "\\|")


def _failure_row(failure: Failure) -> tuple[str, ...]:
    """One cell for each of FAILURE_HEAD."""
    trial, episode = failure.result.trial, failure.result.episode
    infractions = ", ".join(f"{infraction.kind.value} at {infraction.time:.1f} s" for infraction in episode.infractions)
    errors = "; ".join(failure.errors_before[:3])
    return failure.run, trial.key, episode.outcome.value, str(failure.cause or ""), infractions, errors
