"""The report's pictures, as SVG: success beside the paper's, where infractions happened, errors over time, speed over
distance."""

from __future__ import annotations

import io
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from caldrive.benchmark.evidence import read_trace
from caldrive.benchmark.metrics import cells
from caldrive.benchmark.published import SYSTEMS, success
from caldrive.benchmark.report.runs import BenchmarkRun
from caldrive.datatypes import KMH
from caldrive.results import InfractionKind
from caldrive.world.roads.towns import load_roads

COLORS = ("#1f4e79", "#c8782d", "#4f8a4c", "#8a4c86", "#777777")

MARKS = dict(zip(SYSTEMS, "xv^D", strict=True))

KIND_COLORS = dict(zip(InfractionKind, ("#e0a100", "#8a4c86", "#d9534f", "#444444", "#1f77b4", "#e377c2"), strict=True))

BIN, SLOTS = 5.0, 240  # s, and how many
SHOWN = ("relative_angle", "center_distance", "vehicle_distance")


NO_ERRORS = np.zeros((len(SHOWN), 2, SLOTS))


def svg(figure: Figure) -> str:
    """A figure as text that depends on nothing but its content."""
    buffer = io.StringIO()
    with rc_context({"svg.hashsalt": "caldrive", "svg.fonttype": "none"}):
        figure.savefig(buffer, format="svg", metadata={"Date": None})
    text = buffer.getvalue()
    return text[text.index("<svg") :]


def success_figure(runs: Sequence[BenchmarkRun]) -> str:
    """Success in each cell with its interval, and the paper's systems as marks."""
    figure = Figure(figsize=(12, 4.2), layout="constrained")
    ax = figure.subplots()
    found = {(run.name, c.condition, c.task): c for run in runs for c in cells(run.driven)}
    places = list(dict.fromkeys(key[1:] for key in found))
    width = 0.8 / len(runs)
    for k, run in enumerate(runs):
        at = [(i + (k - (len(runs) - 1) / 2) * width, found.get((run.name, *p))) for i, p in enumerate(places)]
        here = [(x, cell) for x, cell in at if cell is not None]
        x, y = [x for x, _ in here], [cell.percent for _, cell in here]
        spread = [[abs(c.percent - c.interval[side]) for _, c in here] for side in (0, 1)]
        ax.bar(x, y, width * 0.92, color=COLORS[k % len(COLORS)], label=run.name, yerr=spread, ecolor="#222222")
    for system, mark in MARKS.items():
        known = [(i, success(system, *p)) for i, p in enumerate(places)]
        known = [(i, v) for i, v in known if v is not None]
        if known:
            ax.plot(*zip(*known, strict=True), mark, color="black", ms=6, mfc="white", label=f"{system} (paper)", ls="")
    ax.set_xticks(range(len(places)), [f"{task}\n{condition}" for condition, task in places], fontsize=6, rotation=45)
    ax.set(ylabel="% reached in time", ylim=(0, 105))
    figure.legend(loc="outside right upper", fontsize=8)
    return svg(figure)


def map_figure(runs: Sequence[BenchmarkRun], town: str) -> str:
    """Where in a town infractions happened; others' faults are hollow."""
    figure = Figure(figsize=(7, 6), layout="constrained")
    ax = figure.subplots()
    for lane in load_roads(town).lanes.values():
        ax.plot(*lane.line.points.T, color="#cccccc", lw=1.5, zorder=1)
    marks = "os^Dv"
    seen = set()
    for k, run in enumerate(runs):
        for one in run.driven:
            for i in one.result.infractions if one.trial.scenario.town == town else ():
                name = f"{run.name}: {i.kind.value}"
                face = KIND_COLORS[i.kind] if i.at_fault else "none"
                label = None if name in seen else name
                seen.add(name)
                ax.scatter(
                    i.x, i.y, 26, facecolors=face, edgecolors=KIND_COLORS[i.kind], marker=marks[k % 5],
                    label=label, zorder=2,
                )  # fmt: skip
    ax.set(aspect="equal", title=town, xlabel="m", ylabel="m")
    if seen:
        figure.legend(loc="outside right upper", fontsize=7)
    return svg(figure)


def _legend(ax: Axes) -> None:
    if ax.get_legend_handles_labels()[0]:
        ax.legend(fontsize=8)


def traces(run: BenchmarkRun) -> Iterator[dict[str, list[Any]]]:
    """The columns of all episodes whose traces lie in a run's folder."""
    for one in run.driven:
        columns = read_trace(run.folder, one.trial.key)
        if columns is not None:
            yield columns


def _error_sums(columns: dict[str, list[Any]], name: str) -> NDArray[np.float64]:
    """How often a continuous affordance was seen in each slot of time, and the sum of what it was off by (2, SLOTS)."""
    seen, true = (np.array(columns[f"{kind}_{name}"], dtype=float) for kind in ("predicted", "true"))
    slot = np.minimum(np.array(columns["time"]) // BIN, SLOTS - 1).astype(int)
    known = np.isfinite(seen)  # a blind car sees nothing
    wrong = np.abs(seen - true)[known]
    return np.stack([np.bincount(slot[known], weight, SLOTS) for weight in (np.ones_like(wrong), wrong)])


def errors_figure(runs: Sequence[BenchmarkRun]) -> str:
    """Mean absolute error of the continuous affordances over the time since the start; no figure without any."""
    sums = {run.name: sum((_all_error_sums(columns) for columns in traces(run)), NO_ERRORS) for run in runs}
    if not any(counts[:, 0].any() for counts in sums.values()):
        return ""
    figure = Figure(figsize=(12, 3.2), layout="constrained")
    axes = figure.subplots(1, len(SHOWN))
    for k, (agent, of_agent) in enumerate(sums.items()):
        for ax, name, (count, wrong) in zip(axes, SHOWN, of_agent, strict=True):
            enough = count > 50
            at = (np.arange(SLOTS) * BIN)[enough]
            ax.plot(at, wrong[enough] / count[enough], color=COLORS[k % len(COLORS)], label=agent)
            ax.set(title=name.replace("_", " "), xlabel="s since the start")
    for ax in axes:
        ax.set_ylim(bottom=0)
    _legend(axes[0])
    return svg(figure)


def _all_error_sums(columns: dict[str, list[Any]]) -> NDArray[np.float64]:
    """`_error_sums` of each of SHOWN (3, 2, SLOTS)."""
    return np.stack([_error_sums(columns, name) for name in SHOWN])


def speed_figure(runs: Sequence[BenchmarkRun]) -> str:
    """Speed over distance in the longest episode that all agents drove."""
    keys = set.intersection(*({one.trial.key for one in run.driven} for run in runs))
    longest = max(
        (one for one in runs[0].driven if one.trial.key in keys), key=lambda one: one.result.route_length, default=None
    )
    figure = Figure(figsize=(12, 3.2), layout="constrained")
    ax = figure.subplots()
    for k, run in enumerate(runs):
        columns = read_trace(run.folder, longest.trial.key) if longest else None
        if columns is None:
            continue
        ax.plot(columns["route_done"], np.array(columns["speed"]) / KMH, color=COLORS[k % len(COLORS)], label=run.name)
        if k == 0:
            ax.step(columns["route_done"], columns["road_limit"], "k--", lw=1, where="post", label="limit on the signs")
    ax.set(title=longest.trial.key if longest else "", xlabel="m along the route", ylabel="km/h", ylim=(0, None))
    _legend(ax)
    return svg(figure)
