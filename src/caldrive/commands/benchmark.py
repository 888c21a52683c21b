"""The verbs of the benchmark: drive a suite, drive one of its episodes again, report."""

from __future__ import annotations

import time
from dataclasses import asdict, dataclass
from pathlib import Path

import tyro

from caldrive.benchmark.settings import BenchmarkSettings
from caldrive.commands.answer import Answer, Configurable, Output
from caldrive.progress import Progress


@dataclass(frozen=True, kw_only=True)
class Benchmark(BenchmarkSettings, Configurable):
    def run(self, progress: Progress) -> Answer:
        from caldrive.benchmark.metrics import cells, rates
        from caldrive.benchmark.run_folder import RunFolder
        from caldrive.benchmark.runner import benchmark
        from caldrive.commands.tables import benchmark_table

        began, driven, good = time.perf_counter(), 0, 0
        for step in benchmark(self):
            driven, good = driven + 1, good + step.success
            pace = driven / (time.perf_counter() - began)
            left = (step.of - step.done) / pace / 60
            reached = f"{step.done} of {step.of}, {100 * good / driven:.0f} % reached"
            progress(f"{reached}, {60 * pace:.0f} a minute, {left:.0f} min left", step.done / step.of)
        results = RunFolder(self.out).driven()
        values = {
            "out": str(self.out),
            "cells": [asdict(cell) | {"percent": cell.percent, "interval": cell.interval} for cell in cells(results)],
            "infractions": {rate.kind.value: {"count": rate.count, "km": rate.km} for rate in rates(results)},
        }
        return Answer(values, benchmark_table(results, str(self.out)))


@dataclass(frozen=True, kw_only=True)
class Replay(Output):
    folder: tyro.conf.Positional[Path]
    """A benchmark's folder."""
    episode: tyro.conf.Positional[str]
    """The episode's key, as in results.jsonl: town01-w01-navigation-10."""
    out: Path = Path("out/replay.mp4")
    """The video."""

    def run(self, progress: Progress) -> Answer:
        from caldrive.benchmark.replay import replay
        from caldrive.results import result_values

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
