"""The right edge of the road: where what can be driven on ends, found along a lane by a robust fit, and tracked.

An edge is a parabola in the frame of a lane, t(s) = a + b s + c s²: s in m along it, t in m to its left. Each look
corrects the last one: points far from where the edge should lie (a junction that opens, somebody who stands on the
kerb) count little, and where nothing is seen the edge stays where it was.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from caldrive.agents.modular_pipeline.ground import CELL, GroundGrid
from caldrive.agents.modular_pipeline.scene import SceneClass
from caldrive.datatypes import Points, Pose
from caldrive.geometry import to_local, to_world

DRIVABLE = (SceneClass.ROAD, SceneClass.LANE_MARKING, SceneClass.DYNAMIC)  # cars and people stand on what is drivable
FREE = (SceneClass.ROAD, SceneClass.LANE_MARKING)  # somebody on the sidewalk opens no road
STATIONS = np.arange(4.0, 13.0, 0.5)  # m along a lane at which its edge is looked for
HIDDEN = 0.25  # probability of a car from which it hides the edge
INSIDE, OUTSIDE = 3.5, 3.75  # m on either side of where the edge should be that are searched
NOISE = 0.2  # m, deviation of a point
FIXED = 1e-6  # a deviation of what does not change


@dataclass(frozen=True)
class Fit:
    """How far an edge is trusted to lie where it is expected."""

    gates: tuple[float, ...]
    """m from the edge from which a point counts nothing, in each round of the fit."""
    drift: tuple[float, float, float]
    """Deviations of a, b and c from one look to the next."""
    share: float = 1.0
    """Of the change that a look asks for, what is made."""


ROAD = Fit(gates=(1.5, 0.8, 0.5), drift=(0.2, 0.05, 0.005), share=0.5)
"""A road that may bend."""
LOST = Fit(gates=(3.5, 2.0, 1.0, 0.5), drift=(1.0, 0.1, 0.005))
"""A road whose edge was not seen for a while."""
ACROSS = Fit(gates=(0.9, 0.6, 0.45), drift=(0.03, 0.004, FIXED))
"""Across a junction, where kerbs round corners lead away from it."""
TARGET = Fit(gates=(2.0, 1.0, 0.6), drift=(0.3, 0.05, FIXED))
"""Of a lane that a turn leads into."""


@dataclass(frozen=True)
class Edge:
    """t(s) = a + b s + c s², and how many points it was last seen at."""

    a: float
    b: float = 0.0
    c: float = 0.0
    points: int = 0

    def at(self, s: NDArray[np.float64]) -> NDArray[np.float64]:
        """t (...) at s (...), m."""
        return self.a + self.b * s + self.c * s * s

    def beside(self, distance: float, s: NDArray[np.float64]) -> Points:
        """Points (N, 2) so many metres to the left of the edge, at s (N,)."""
        slope = np.arctan(self.b + 2 * self.c * s)
        return np.stack((s - distance * np.sin(slope), self.at(s) + distance * np.cos(slope)), axis=1)

    def moved(self, motion: Pose) -> Edge:
        """The same edge seen from where a car is that has moved so."""
        s = np.linspace(0.0, 12.0, 13)
        seen = to_local(motion, np.stack((s, self.at(s)), axis=1))
        c, b, a = np.polyfit(seen[:, 0], seen[:, 1], 2).tolist()
        return replace(self, a=a, b=b, c=c)


def edge_points(
    grid: GroundGrid, expected: Edge, frame: Pose, stations: NDArray[np.float64] = STATIONS
) -> NDArray[np.float64]:
    """Where the road ends at each station (N,) of a lane's frame: t in m, NaN where that is not seen near where it is
    expected. The search goes outwards from the lane."""
    offsets = np.arange(INSIDE, -OUTSIDE, -CELL)
    t = expected.at(stations)[:, None] + offsets  # (N, K)
    s = np.broadcast_to(stations[:, None], t.shape)
    classes, seen = grid.at(to_world(frame, np.stack((s, t), axis=-1)))
    drivable = classes[..., DRIVABLE].sum(-1)
    outside = (drivable < 0.5) & seen
    k = outside.argmax(axis=1)
    rows = np.arange(len(stations))
    inner = classes[rows, k - 1]
    usable = outside[rows, k] & (k > 0) & seen[rows, k - 1] & (inner[:, SceneClass.DYNAMIC] < HIDDEN)
    before, here = drivable[rows, k - 1], drivable[rows, k]
    share = (before - 0.5) / np.maximum(before - here, 1e-6)
    return np.where(usable, t[rows, k - 1] - share * CELL, np.nan)


def fit_edge(points: NDArray[np.float64], expected: Edge, fit: Fit, stations: NDArray[np.float64] = STATIONS) -> Edge:
    """The edge through points (N,) at stations (N,), NaN for none, near where it is expected."""
    found = np.isfinite(points)
    s, residual = stations[found], points[found] - expected.at(stations[found])
    powers = np.stack((np.ones_like(s), s, s * s), axis=1)
    prior = np.diag([(NOISE / drift) ** 2 for drift in fit.drift])
    change: NDArray[np.float64] = np.zeros(3)
    weights = _tukey(residual, fit.gates[0])
    for gate in fit.gates:
        weights = _tukey(residual - powers @ change, gate)
        weighted = powers * weights[:, None]
        change = np.asarray(np.linalg.solve(weighted.T @ powers + prior, weighted.T @ residual), np.float64)
    a, b, c = (fit.share * change).tolist()
    seen = int((weights > 0.25).sum())
    return Edge(expected.a + a, expected.b + b, expected.c + c, seen)


def _tukey(errors: NDArray[np.float64], gate: float) -> NDArray[np.float64]:
    """Tukey's weights (N,) of errors (N,): 1 for none, 0 from the gate on."""
    weights: NDArray[np.float64] = np.clip(1 - (errors / gate) ** 2, 0, None) ** 2
    return weights


def opening(grid: GroundGrid, edge: Edge, *, side: float, stations: NDArray[np.float64]) -> float | None:
    """How far ahead (m) the road begins to widen: the first of three places in a row where what can be driven on
    reaches a metre beyond the edge. side: m to the left of the edge at which the other edge lies, 0 for this one."""
    line = edge.at(stations)
    beyond = np.where(side > 0, line + side + 1.0, line - 1.0)
    inner = np.where(side > 0, line + side - 1.0, line + 1.0)
    outer, seen = grid.at(np.stack((stations, beyond), axis=1))
    within, seen_within = grid.at(np.stack((stations, inner), axis=1))
    open = (outer[:, FREE].sum(-1) > 0.5) & seen
    closed = ~open & seen & seen_within & (within[:, DRIVABLE].sum(-1) > 0.5)
    for k in range(1, len(stations) - 2):
        if open[k : k + 3].all():
            return float(stations[k]) if closed[k - 1] else None
    return None
