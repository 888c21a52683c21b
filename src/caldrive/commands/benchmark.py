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
    """Drive a whole suite; what a folder holds already is kept, and the rest is driven."""

    def run(self, progress: Progress) -> Answer:
        """Drives, and shows success and infractions of all that the folder holds."""
        from caldrive.benchmark.metrics import cells, infraction_rates
        from caldrive.benchmark.run_folder import RunFolder
        from caldrive.benchmark.runner import benchmark
        from caldrive.commands.tables import benchmark_table

        start, driven, successes = time.perf_counter(), 0, 0
        for state in benchmark(self):
            driven, successes = driven + 1, successes + state.success
            per_second = driven / (time.perf_counter() - start)
            minutes_left = (state.total - state.done) / per_second / 60
            reached = f"{state.done} of {state.total}, {100 * successes / driven:.0f} % reached"
            pace = f"{60 * per_second:.0f} a minute, {minutes_left:.0f} min left"
            progress(f"{reached}, {pace}", state.done / state.total)
        results = RunFolder(self.out).results()
        rates = infraction_rates(results)
        values = {
            "out": str(self.out),
            "cells": [asdict(cell) | {"percent": cell.percent, "interval": cell.interval} for cell in cells(results)],
            "infractions": {rate.kind.value: {"count": rate.count, "km": rate.km} for rate in rates},
        }
        return Answer(values, benchmark_table(results, str(self.out)))


@dataclass(frozen=True, kw_only=True)
class Replay(Output):
    """Drive a benchmark's episode again, and film it."""

    folder: tyro.conf.Positional[Path]
    """A benchmark's folder."""
    episode: tyro.conf.Positional[str]
    """The episode's key, as in results.jsonl: town01-w01-navigation-10."""
    out: Path = Path("out/replay.mp4")
    """The video."""

    def run(self, progress: Progress) -> Answer:
        """Drives and films; the exit code is 1 where it went otherwise than before."""
        from caldrive.benchmark.replay import replay
        from caldrive.results import result_values

        again = replay(self.folder, self.episode, self.out, progress)
        infractions = [f"{infraction.kind.value} at {infraction.time:.1f} s" for infraction in again.result.infractions]
        same = "as before" if again.same else "not as before: other code, another model or no earlier result"
        sentence = f"{self.episode} {again.result.outcome.value}; infractions: {', '.join(infractions) or 'none'}"
        values = {"video": str(again.video), "same": again.same, "result": result_values(again.result)}
        return Answer(values, f"{sentence}; video: {again.video}; {same}", int(not again.same))


@dataclass(frozen=True, kw_only=True)
class Report(Output):
    """Tables and a page on one or more benchmarks."""

    folders: tyro.conf.Positional[tuple[Path, ...]]
    """Benchmarks' folders, side by side in the report."""
    out: Path = Path("out/report")
    """Folder for report.md and report.html."""
    attention: bool = False
    """Drive failures again, 30 at most, and draw what the network looked at before each; what is drawn already is shown
    without this, too."""

    def run(self, progress: Progress) -> Answer:
        """Writes the report as Markdown and as an HTML page."""
        from caldrive.benchmark.report.page import report_page, report_text
        from caldrive.benchmark.report.runs import failures, load_runs
        from caldrive.checks import require_writable_folder
        from caldrive.explain.blame import with_blame
        from caldrive.explain.failure_pictures import draw_pictures, with_pictures
        from caldrive.files import locked_folder, write_whole

        if not self.folders:
            raise ValueError("found no folder, wanted a benchmark's: type caldrive report out/benchmark")
        runs = [with_blame(run) for run in load_runs(self.folders)]
        require_writable_folder(self.out)
        if self.attention:
            draw_pictures(runs, progress)
        runs = [with_pictures(run) for run in runs]
        progress("writing", 0.9)
        text, page = report_text(runs), report_page(runs)
        with locked_folder(self.out):
            write_whole(self.out / "report.md", text.encode())
            write_whole(self.out / "report.html", page.encode())
        explained = [failure.explanation for failure in failures(runs)]
        values = {
            "out": str(self.out), "runs": [run.name for run in runs], "failures": len(explained),
            "blamed": sum(why.blame != "" for why in explained),
            "pictured": sum(why.moments != () for why in explained),
        }  # fmt: skip
        return Answer(values, f"report: {self.out / 'report.html'}, {self.out / 'report.md'}")
