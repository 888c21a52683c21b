"""The report as Markdown."""

from __future__ import annotations

from collections.abc import Sequence

from caldrive.driving.report import BenchmarkRun, failures
from caldrive.driving.report_tables import tables


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
