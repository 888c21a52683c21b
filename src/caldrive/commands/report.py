"""The verbs of the benchmark: drive a suite, drive one of its episodes again, report."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import tyro

from caldrive.commands.answer import Answer, Output
from caldrive.progress import Progress


@dataclass(frozen=True, kw_only=True)
class Report(Output):
    folders: tyro.conf.Positional[tuple[Path, ...]]
    """Benchmarks' folders, side by side in the report."""
    out: Path = Path("out/report")
    """Folder for report.md and report.html."""

    def run(self, progress: Progress) -> Answer:
        from caldrive.benchmark.report.page import report_page, report_text
        from caldrive.benchmark.report.runs import failures, load_runs
        from caldrive.checks import require_writable_folder
        from caldrive.files import write_whole

        if not self.folders:
            raise ValueError("found no folder, wanted a benchmark's: type caldrive report out/benchmark")
        runs = load_runs(self.folders)
        require_writable_folder(self.out)
        progress("writing", 0.2)
        text, page = report_text(runs), report_page(runs)
        write_whole(self.out / "report.md", text.encode())
        write_whole(self.out / "report.html", page.encode())
        values = {"out": str(self.out), "runs": [run.name for run in runs], "failures": len(failures(runs))}
        return Answer(values, f"report: {self.out / 'report.html'}, {self.out / 'report.md'}")
