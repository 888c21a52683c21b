"""Where things went wrong, as maps: of the towns with the most of it, as a page has no room for a hundred."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from html import escape
from pathlib import Path
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from caldrive.benchmark.report.figures import svg
from caldrive.benchmark.report.runs import BenchmarkRun
from caldrive.results import InfractionKind
from caldrive.world.roads.towns import load_roads

MOST = 6  # maps on a page
RUN_MARKERS = "os^Dv"
MISSED = "goal missed"  # at the place where that began
_COLORS = ("#e0a100", "#8a4c86", "#d9534f", "#444444", "#1f77b4", "#e377c2", "#f0d000", "#2ca02c")
COLORS = dict(zip((kind.value for kind in InfractionKind), _COLORS, strict=True)) | {MISSED: "#000000"}


class Group(NamedTuple):
    """What is drawn with one marker."""

    run: int
    """Whose, by its number."""
    kind: str
    """A key of COLORS."""
    at_fault: bool
    """Whether the agent is to blame."""


Places = dict[Group, list[tuple[float, float]]]  # x and y in m


def maps(runs: Sequence[BenchmarkRun]) -> str:
    """Maps of the towns in which most went wrong, and a sentence on those that are left out; empty where nothing went
    wrong."""
    towns = dict.fromkeys(result.trial.scenario.town for run in runs for result in run.results)
    places = {town: found for town in towns if (found := _places(runs, town))}
    shown = sorted(places, key=lambda town: _much(places[town]), reverse=True)[:MOST]
    if not shown:
        return ""
    figures = "".join(map_figure([run.name for run in runs], town, places[town]) for town in shown)
    return f'<p>{escape(_said(len(towns), list(places), shown))}</p><div class="maps">{figures}</div>'


def _much(places: Places) -> tuple[int, int]:
    """How much went wrong: by the agents' fault, and in all."""
    own = sum(len(points) for group, points in places.items() if group.at_fault)
    return own, sum(map(len, places.values()))


def _said(towns: int, wrong: Sequence[str], shown: Sequence[str]) -> str:
    """What the maps show, and what they leave out."""
    left_out = [Path(town).stem for town in wrong if town not in shown]
    said = f"Something went wrong in {len(wrong)} of {towns} towns. Hollow: the fault of others."
    if not left_out:
        return said
    return f"{said} The {len(shown)} towns with most of it are drawn; left out: {', '.join(left_out)}."


def _places(runs: Sequence[BenchmarkRun], town: str) -> Places:
    """Where in a town something went wrong."""
    found = Places()
    for k, run in enumerate(runs):
        for kind, at_fault, place in _wrongs(run, town):
            found.setdefault(Group(k, kind, at_fault), []).append(place)
    return found


def _wrongs(run: BenchmarkRun, town: str) -> Iterator[tuple[str, bool, tuple[float, float]]]:
    """Infractions, and missed goals as far as it is known where that began."""
    for result in run.results:
        if result.trial.scenario.town == town:
            for infraction in result.episode.infractions:
                yield infraction.kind.value, infraction.at_fault, (infraction.x, infraction.y)
    for failure in run.failures:
        if failure.result.trial.scenario.town == town and failure.cause is not None:
            yield MISSED, True, (failure.cause.x, failure.cause.y)


def map_figure(names: Sequence[str], town: str, places: Mapping[Group, Sequence[tuple[float, float]]]) -> str:
    """A town with the places where something went wrong; others' faults are hollow. names: of the runs."""
    figure = Figure(figsize=(7, 6), layout="constrained")
    ax = figure.subplots()
    for lane in load_roads(town).lanes.values():
        ax.plot(*lane.line.points.T, color="#cccccc", lw=1.5, zorder=1)
    labels = set[str]()
    for group, points in places.items():
        label = f"{names[group.run]}: {group.kind}"
        _mark(ax, group, points, None if label in labels else label)
        labels.add(label)
    ax.set(aspect="equal", title=Path(town).stem, xlabel="m", ylabel="m")
    figure.legend(loc="outside right upper", fontsize=7)
    return svg(figure)


def _mark(ax: Axes, group: Group, points: Sequence[tuple[float, float]], label: str | None) -> None:
    """Draws the places of a group as pixels: hundreds of them take no more room than one."""
    (x, y), color = np.array(points).T, COLORS[group.kind]
    ax.scatter(
        x, y, 26, facecolors=color if group.at_fault else "none", edgecolors=color,
        marker=RUN_MARKERS[group.run % len(RUN_MARKERS)], label=label, zorder=2, rasterized=True,
    )  # fmt: skip
