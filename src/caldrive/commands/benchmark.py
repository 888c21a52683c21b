"""The verb that drives a suite."""

from __future__ import annotations

import time
from dataclasses import asdict, dataclass

from caldrive.benchmark.settings import BenchmarkSettings
from caldrive.commands.answer import Answer, Output
from caldrive.progress import Progress


@dataclass(frozen=True, kw_only=True)
class Benchmark(BenchmarkSettings, Output):
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
