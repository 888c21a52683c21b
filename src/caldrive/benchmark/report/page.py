"""The report as one HTML page that fetches nothing: tables that sort, failures that filter, plots and stills inside."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from html import escape
from pathlib import Path

from caldrive.benchmark.evidence import still_paths
from caldrive.benchmark.report.figures import errors_figure, map_figure, speed_figure, success_figure
from caldrive.benchmark.report.runs import BenchmarkRun, Failure, failures
from caldrive.benchmark.report.tables import Table, tables
from caldrive.results import Outcome

_DATA = Path(__file__).parent
MOST_STILLS = 120  # on one page; beyond that it would be long to open and large to keep


def report_page(runs: Sequence[BenchmarkRun]) -> str:
    """The whole page."""
    style, script = ((_DATA / name).read_text() for name in ("report.css", "report.js"))
    towns = list(dict.fromkeys(one.trial.scenario.town for run in runs for one in run.driven))
    about, success, *others = tables(runs)
    figures = {
        "Success, with the paper's systems": success_figure(runs),
        "Where rules were broken": "".join(map_figure(runs, town) for town in towns),
        "Errors of the affordances over time": errors_figure(runs),
        "Speed over distance": speed_figure(runs),
    }
    plots = (f"<section><h2>{escape(name)}</h2>{made}</section>" for name, made in figures.items() if made)
    first, *rest = plots
    body = [_table(about), _table(success), first, *map(_table, others), *rest, _failures(runs)]
    return (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8"><title>caldrive benchmark</title>'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<style>{style}</style></head><body><main><h1>Benchmark</h1>{''.join(body)}</main>"
        f"<script>{script}</script></body></html>\n"
    )


def _table(table: Table) -> str:
    head = "".join(f"<th>{escape(name)}</th>" for name in table.head)
    rows = "".join("<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>" for row in table.rows)
    return (
        f"<section><h2>{escape(table.title)}</h2><p>{escape(table.text)}</p>"
        f'<div class="wide"><table class="sortable"><thead><tr>{head}</tr></thead><tbody>{rows}</tbody></table></div>'
        "</section>"
    )


def _failures(runs: Sequence[BenchmarkRun]) -> str:
    found, folders = failures(runs), {run.name: run.folder for run in runs}
    kinds = sorted({i.kind.value for one in found for i in one.episode.result.infractions})
    choices = {
        "run": list(dict.fromkeys(one.run for one in found)),
        "condition": list(dict.fromkeys(one.episode.trial.condition for one in found)),
        "task": list(dict.fromkeys(one.episode.trial.scenario.task for one in found)),
        "kind": [*kinds, "goal missed"],
    }
    menus = "".join(
        f'<label>{name} <select data-filter="{name}"><option value="">all</option>'
        + "".join(f"<option>{escape(value)}</option>" for value in values)
        + "</select></label>"
        for name, values in choices.items()
    )
    shown = _stills(found, folders)
    cards = [_card(one, stills) for one, stills in zip(found, shown, strict=True)]
    text = (
        f'<p><span id="shown">{len(found)}</span> of {len(found)} episodes that missed their goal or broke a rule.'
        f" {sum(map(len, shown))} stills, first of those that broke a rule; the folder of a run has all.</p>"
    )
    return f'<section id="failures"><h2>Failures</h2>{text}<p class="menus">{menus}</p>{"".join(cards)}</section>'


def _stills(found: Sequence[Failure], folders: dict[str, Path]) -> list[Sequence[Path]]:
    """For each failure the stills to show, MOST_STILLS in all: who broke a rule goes before who only took too long."""
    shown: list[Sequence[Path]] = [()] * len(found)
    left = MOST_STILLS
    for k in sorted(range(len(found)), key=lambda k: not found[k].episode.result.infractions):
        one = found[k]
        shown[k] = still_paths(folders[one.run], one.episode.trial.key)[:left]
        left -= len(shown[k])
    return shown


def _card(failure: Failure, stills: Sequence[Path]) -> str:
    one = failure.episode
    broken = [
        f"<li>{escape(i.kind.value)} at {i.time:.1f} s{'' if i.at_fault else ', by others'}"
        f"<small>wrong in the 3 s before: {escape(before)}</small></li>"
        for i, before in zip(one.result.infractions, failure.before, strict=True)
    ]
    kinds = sorted({i.kind.value for i in one.result.infractions})
    kinds += ["goal missed"] if one.result.outcome is not Outcome.SUCCESS else []
    data = {
        "run": failure.run, "condition": one.trial.condition, "task": one.trial.scenario.task, "kind": "|".join(kinds)
    }  # fmt: skip
    attributes = "".join(f' data-{name}="{escape(value)}"' for name, value in data.items())
    images = "".join(
        f'<img alt="still" src="data:image/jpeg;base64,{base64.b64encode(path.read_bytes()).decode()}">'
        for path in stills
    )
    driven = f"{one.result.route_done:.0f} of {one.result.route_length:.0f} m in {one.result.duration:.0f} s"
    began = f"<p>{escape(str(failure.cause))}</p>" if failure.cause else ""
    return (
        f'<article class="card"{attributes}><h3>{escape(one.trial.key)} <em>{escape(failure.run)}</em></h3>'
        f"<p>{escape(one.result.outcome.value)}; {driven}</p>{began}<ol>{''.join(broken)}</ol>{images}</article>"
    )


def report_text(runs: Sequence[BenchmarkRun]) -> str:
    """The report as Markdown."""
    parts, found = ["# Benchmark", ""], failures(runs)
    for table in tables(runs):
        parts += [f"## {table.title}", "", table.text, "", "| " + " | ".join(table.head) + " |"]
        parts += ["|" + "---|" * len(table.head), *("| " + " | ".join(row) + " |" for row in table.rows), ""]
    parts += ["## Failures", "", f"{len(found)} episodes missed their goal or broke a rule.", ""]
    head = ("agent", "episode", "outcome", "how it began", "infractions", "wrong in the 3 s before")
    parts += ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    for one in found:
        broken = ", ".join(f"{i.kind.value} at {i.time:.1f} s" for i in one.episode.result.infractions)
        before = "; ".join(one.before[:3])
        cells = (one.run, one.episode.trial.key, one.episode.result.outcome.value, str(one.cause or ""), broken, before)
        parts.append("| " + " | ".join(cells) + " |")
    return "\n".join(parts) + "\n"
