"""The report's figures, as SVG: success beside the paper's, errors over time, speed over distance."""

from __future__ import annotations

import io
from collections.abc import Collection, Iterator, Sequence
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from caldrive.affordances import CONTINUOUS
from caldrive.benchmark.artifacts import read_trace
from caldrive.benchmark.published import SYSTEMS, success
from caldrive.benchmark.report.runs import BenchmarkRun, cells_by_place, suites
from caldrive.datatypes import KMH

RUN_COLORS = ("#1f4e79", "#c8782d", "#4f8a4c", "#8a4c86", "#777777")
SYSTEM_MARKERS = dict(zip(SYSTEMS, "xv^D", strict=True))
BIN, BINS = 5.0, 240  # s of a bin of time, and how many there are; the last one takes what is later
MIN_STEPS = 50  # in a bin, from which its mean is drawn


def svg(figure: Figure) -> str:
    """A figure as text that depends on nothing but its content."""
    buffer = io.StringIO()
    with rc_context({"svg.hashsalt": "caldrive", "svg.fonttype": "none"}):
        figure.savefig(buffer, format="svg", metadata={"Date": None})
    text = buffer.getvalue()
    return text[text.index("<svg") :]


def success_figure(runs: Sequence[BenchmarkRun]) -> str:
    """Success in each cell with its interval, and the paper's systems as markers."""
    figure = Figure(figsize=(12, 4.2), layout="constrained")
    ax = figure.subplots()
    by_place = cells_by_place(runs)
    places = list(dict.fromkeys((condition, task) for _, condition, task in by_place))
    width = 0.8 / len(runs)
    for k, run in enumerate(runs):
        offset = (k - (len(runs) - 1) / 2) * width
        cells_at = [(i + offset, by_place.get((run.name, *place))) for i, place in enumerate(places)]
        bars = [(x, cell) for x, cell in cells_at if cell is not None]
        percents = [cell.percent for _, cell in bars]
        error_bars = [[abs(cell.percent - cell.interval[side]) for _, cell in bars] for side in (0, 1)]
        ax.bar(
            [x for x, _ in bars], percents, width * 0.92, color=_run_color(k), label=run.name, yerr=error_bars,
            ecolor="#222222",
        )  # fmt: skip
    _mark_published(ax, places, suites(runs))
    ax.set_xticks(range(len(places)), [f"{task}\n{condition}" for condition, task in places], fontsize=6, rotation=45)
    lowest = min((cell.interval[0] for cell in by_place.values()), default=0.0)
    ax.set(ylabel="% reached in time", ylim=(lowest_percent(lowest, places, suites(runs)), 101))
    figure.legend(loc="outside right upper", fontsize=8)
    return svg(figure)


def lowest_percent(lowest: float, places: Sequence[tuple[str, str]], of: Collection[str] = ()) -> float:
    """Where the axis begins: below all of ours and all of the paper's, at a whole ten, so that the bars' ends can be
    told apart."""
    published = [success(system, *place, of) for place in places for system in SYSTEM_MARKERS]
    return 10.0 * (min([lowest, *(percent for percent in published if percent is not None)]) // 10)


def _mark_published(ax: Axes, places: Sequence[tuple[str, str]], of: Collection[str]) -> None:
    """What the published systems reached in some suites, at the cells' numbers."""
    for system, marker in SYSTEM_MARKERS.items():
        percents = ((i, success(system, *place, of)) for i, place in enumerate(places))
        points = [(i, percent) for i, percent in percents if percent is not None]
        if points:
            label = f"{system} (published)"
            ax.plot(*zip(*points, strict=True), marker, color="black", ms=6, mfc="white", label=label, ls="")


def _run_color(k: int) -> str:
    return RUN_COLORS[k % len(RUN_COLORS)]


def _legend(ax: Axes) -> None:
    if ax.get_legend_handles_labels()[0]:
        ax.legend(fontsize=8)


def _traces(run: BenchmarkRun) -> Iterator[dict[str, list[Any]]]:
    """The columns of all episodes whose traces lie in a run's folder."""
    for result in run.results:
        columns = read_trace(run.folder, result.trial.key)
        if columns is not None:
            yield columns


def error_sums(columns: dict[str, list[Any]], name: str) -> NDArray[np.float64]:
    """How often a continuous affordance was known in each bin of time, and the sum of its errors (2, BINS)."""
    predicted, true = (np.array(columns[f"{kind}_{name}"], dtype=float) for kind in ("predicted", "true"))
    bins = np.minimum(np.array(columns["time"]) // BIN, BINS - 1).astype(int)
    known = np.isfinite(predicted)  # a blind car sees nothing
    errors = np.abs(predicted - true)[known]
    return np.stack([np.bincount(bins[known], weight, BINS) for weight in (np.ones_like(errors), errors)])


def _run_error_sums(run: BenchmarkRun) -> NDArray[np.float64]:
    """`error_sums` over a run's traces, of each of CONTINUOUS (3, 2, BINS)."""
    sums = np.zeros((len(CONTINUOUS), 2, BINS))
    for columns in _traces(run):
        sums += [error_sums(columns, spec.name) for spec in CONTINUOUS]
    return sums


def errors_figure(runs: Sequence[BenchmarkRun]) -> str:
    """Mean absolute error of the continuous affordances over the time since the start; empty where no agent gives
    any."""
    sums = [_run_error_sums(run) for run in runs]
    if not any(run_sums[:, 0].any() for run_sums in sums):
        return ""
    figure = Figure(figsize=(12, 3.2), layout="constrained")
    axes = figure.subplots(1, len(CONTINUOUS))
    for k, (run, run_sums) in enumerate(zip(runs, sums, strict=True)):
        for ax, (count, total) in zip(axes, run_sums, strict=True):
            enough = count > MIN_STEPS
            times = (np.arange(BINS) * BIN)[enough]
            ax.plot(times, total[enough] / count[enough], color=_run_color(k), label=run.name)
    for ax, spec in zip(axes, CONTINUOUS, strict=True):
        ax.set(title=spec.title, xlabel="s since the start", ylabel=spec.unit)
        ax.set_ylim(bottom=0)
    _legend(axes[0])
    return svg(figure)


def speed_figure(runs: Sequence[BenchmarkRun]) -> str:
    """Speed over distance in the longest episode that all agents drove."""
    keys = set.intersection(*({result.trial.key for result in run.results} for run in runs))
    shared = [result for result in runs[0].results if result.trial.key in keys]
    longest = max(shared, key=lambda result: result.episode.route_length, default=None)
    figure = Figure(figsize=(12, 3.2), layout="constrained")
    ax = figure.subplots()
    for k, run in enumerate(runs):
        columns = read_trace(run.folder, longest.trial.key) if longest else None
        if columns is None:
            continue
        done, speed = columns["route_done"], np.array(columns["speed"]) / KMH
        ax.plot(done, speed, color=_run_color(k), label=run.name)
        if k == 0:
            ax.step(done, columns["road_limit"], "k--", lw=1, where="post", label="limit on the signs")
    ax.set(title=longest.trial.key if longest else "", xlabel="m along the route", ylabel="km/h", ylim=(0, None))
    _legend(ax)
    return svg(figure)
