"""An episode as a picture: speed over distance, the limits it should keep to, and where the car stopped for what."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np

from caldrive.control.longitudinal import DriveState
from caldrive.datatypes import KMH
from caldrive.files import write_figure

SHADES = {
    DriveState.HAZARD_STOP.value: "#d9534f",
    DriveState.RED_LIGHT.value: "#e8908d",
    DriveState.OVER_LIMIT.value: "#f0c36d",
    DriveState.FOLLOWING.value: "#b8d4ea",
    DriveState.CREEPING.value: "#d8cf8a",
    DriveState.BLIND.value: "#999999",
}


def draw_speed(columns: Mapping[str, Sequence[Any]], title: str, path: Path) -> None:
    """Writes a PNG of an episode's trace (`Trace.columns`)."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(12, 3.6), layout="constrained")
    ax = figure.subplots()
    done, states = np.array(columns["route_done"]), columns["state"]
    labelled: set[str] = set()
    for state, run in groupby(range(len(done)), key=lambda i: states[i]):
        if state in SHADES:
            rows = list(run)
            reach = max(done[rows[-1]], done[rows[0]] + 0.5)
            ax.axvspan(done[rows[0]], reach, color=SHADES[state], lw=0, label=None if state in labelled else state)
            labelled.add(state)
    ax.step(done, columns["road_limit"], "k--", lw=1, label="limit on the signs", where="post")
    ax.step(done, columns["speed_limit"], color="#c8782d", lw=1.5, label="limit that the agent keeps to", where="post")
    ax.plot(done, np.array(columns["speed"]) / KMH, color="#1f4e79", lw=2, label="speed")
    ax.set(title=title, xlabel="m along the route", ylabel="km/h", xlim=(0, None), ylim=(0, None))
    figure.legend(loc="outside right upper", fontsize=8)
    write_figure(path, figure)
