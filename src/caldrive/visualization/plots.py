"""An episode as a picture: speed over distance, the limits it should keep to, and where the car stopped for what."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from caldrive.control.longitudinal import DriveState
from caldrive.datatypes import KMH
from caldrive.files import write_figure

SHORTEST = 0.5  # m of a stretch, so that a stand shows, too
SHADES = {
    DriveState.HAZARD_STOP.value: "#d9534f",
    DriveState.RED_LIGHT.value: "#e8908d",
    DriveState.OVER_LIMIT.value: "#f0c36d",
    DriveState.FOLLOWING.value: "#b8d4ea",
    DriveState.CREEPING.value: "#d8cf8a",
    DriveState.BLIND.value: "#999999",
}


def draw_speed(columns: Mapping[str, Sequence[Any]], title: str, path: Path) -> None:
    """Writes a PNG of an episode's trace (`Trace.columns`); what an agent does not tell is left out."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(12, 3.6), layout="constrained")
    ax = figure.subplots()
    along = _numbers(columns["route_done"])
    _shade_states(ax, along, columns["state"])
    _draw_limit(ax, along, columns["road_limit"], color="k", ls="--", lw=1, label="limit on the signs")
    _draw_limit(ax, along, columns["speed_limit"], color="#c8782d", lw=1.5, label="limit that the agent keeps to")
    ax.plot(along, _numbers(columns["speed"]) / KMH, color="#1f4e79", lw=2, label="speed")
    ax.set(title=title, xlabel="m along the route", ylabel="km/h", xlim=(0, None), ylim=(0, None))
    figure.legend(loc="outside right upper", fontsize=8)
    write_figure(path, figure)


def _numbers(column: Sequence[Any]) -> NDArray[np.float64]:
    """A column with NaN where there is no value."""
    return np.array(column, dtype=np.float64)


def _draw_limit(ax: Any, along: NDArray[np.float64], column: Sequence[Any], **style: Any) -> None:
    """A limit in km/h as steps along the route, if there is any."""
    limits = _numbers(column)
    if np.isfinite(limits).any():
        ax.step(along, limits, where="post", **style)


def _shade_states(ax: Any, along: NDArray[np.float64], states: Sequence[str | None]) -> None:
    """Colours the stretches in which the agent was in one of the known states; at least half a metre of each."""
    labelled: set[str] = set()
    for state, group in groupby(range(len(along)), key=lambda step: states[step]):
        if state in SHADES:
            steps = list(group)
            start, end = along[steps[0]], along[steps[-1]]
            label = None if state in labelled else state
            ax.axvspan(start, max(end, start + SHORTEST), color=SHADES[state], lw=0, label=label)
            labelled.add(state)
