"""The verbs of the benchmark: drive a suite, drive one of its episodes again, report."""

from __future__ import annotations

import time
from dataclasses import asdict, dataclass
from pathlib import Path

import tyro

from caldrive.commands.answer import Answer, Output
from caldrive.driving.settings import BenchmarkSettings
from caldrive.progress import Progress


@dataclass(frozen=True)
class Benchmark(BenchmarkSettings, Output):
    def run(self, progress: Progress) -> Answer:
        from caldrive.driving.benchmark import benchmark, read_results
        from caldrive.driving.measures import cells, rates
        from caldrive.driving.tables_benchmark import benchmark_table

        began, driven, good = time.perf_counter(), 0, 0
        for done, of, success in benchmark(self):
            driven, good = driven + 1, good + success
            pace = driven / (time.perf_counter() - began)
            left = (of - done) / pace / 60
            label = (
                f"{done} of {of}, {100 * good / driven:.0f} % reached, {60 * pace:.0f} a minute, {left:.0f} min left"
            )
            progress(label, done / of)
        found = read_results(self)
        values = {
            "out": str(self.out),
            "cells": [asdict(cell) | {"percent": cell.percent, "interval": cell.interval} for cell in cells(found)],
            "infractions": {rate.kind.value: {"count": rate.count, "km": rate.km} for rate in rates(found)},
        }
        return Answer(values, benchmark_table(found, str(self.out)))


@dataclass(frozen=True, kw_only=True)
class Replay(Output):
    folder: tyro.conf.Positional[Path]
    """A benchmark's folder."""
    episode: tyro.conf.Positional[str]
    """The episode's key, as in results.jsonl: town01-w01-navigation-10."""
    out: Path = Path("out/replay.mp4")
    """The video."""

    def run(self, progress: Progress) -> Answer:
        from caldrive.driving.replay import replay
        from caldrive.driving.trace import result_values

        found = replay(self.folder, self.episode, self.out, progress)
        broken = ", ".join(f"{one.kind.value} at {one.time:.1f} s" for one in found.result.infractions) or "none"
        said = f"{self.episode} {found.result.outcome.value}; infractions: {broken}; video: {found.video}"
        same = "as before" if found.same else "not as before: other code, another model or no earlier result"
        values = {"video": str(found.video), "same": found.same, "result": result_values(found.result)}
        return Answer(values, f"{said}; {same}", int(not found.same))


@dataclass(frozen=True, kw_only=True)
class Report(Output):
    folders: tyro.conf.Positional[tuple[Path, ...]]
    """Benchmarks' folders, side by side in the report."""
    out: Path = Path("out/report")
    """Folder for report.md and report.html."""

    def run(self, progress: Progress) -> Answer:
        from caldrive.driving.outputs import require_writable_folder
        from caldrive.driving.report import failures, load_runs
        from caldrive.driving.report_page import report_page
        from caldrive.driving.report_text import report_text
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
