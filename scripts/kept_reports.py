"""Writes the reports in docs/results again, from the lines that are kept beside them and in the words of today.

    python -m scripts.kept_reports

How a missed goal began is read from a trace, and traces are not kept: those sentences stay as they were written.
"""

from __future__ import annotations

import sys
from pathlib import Path

from caldrive.benchmark.report.page import FAILURE_HEAD, report_text
from caldrive.benchmark.report.runs import load_runs
from caldrive.files import write_whole
from scripts import drive_results

RESULTS = Path(__file__).parents[1] / "docs" / "results"
SUITES = tuple(sorted(path.parent.name for path in RESULTS.glob("*/report.md")))
CAUSES, FAILURES = "## Failure causes\n", "## Failures\n"
CAUSE = FAILURE_HEAD.index("how it began")


def report_again(folder: Path) -> str:
    """The report on a suite's kept lines, with the causes that the kept report holds."""
    before, found, kept_failures = (folder / "report.md").read_text().partition(FAILURES)
    _, *causes = before.partition(CAUSES)
    drivers = [folder / name for name in drive_results.SUITES[folder.name] if (folder / name).exists()]
    tables, _, failures = report_text(load_runs(drivers)).partition(FAILURES)
    known = {tuple(cells[:2]): cells[CAUSE] for cells in map(_cells, kept_failures.splitlines()) if len(cells) > CAUSE}
    rows = [_with_cause(row, known) for row in failures.splitlines(keepends=True)]
    return "".join([tables, *causes, found, *rows])


def _cells(row: str) -> list[str]:
    return row.strip("|\n").split("|")


def _with_cause(row: str, known: dict[tuple[str, ...], str]) -> str:
    """A row of the failures with what is known of how it began."""
    cells = _cells(row)
    if len(cells) <= CAUSE or tuple(cells[:2]) not in known:
        return row
    cells[CAUSE] = known[tuple(cells[:2])]
    return f"|{'|'.join(cells)}|\n"


def main() -> int:
    for name in SUITES:
        write_whole(RESULTS / name / "report.md", report_again(RESULTS / name).encode())
    return 0


if __name__ == "__main__":
    sys.exit(main())
