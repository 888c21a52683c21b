"""Plans of towns: junctions joined by streets. Those of the package's own towns stand here.

Limits follow one rule: 30 around junctions and corners, 60 where the free stretch allows it, 90 on the longest ones.
`python -m caldrive.world.roads.plans` writes the shipped networks.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from caldrive.datatypes import Points
from caldrive.files import write_whole

LANE_WIDTH = 4.0  # m
CORNER_RADIUS = 20.0  # m
AFTER_JUNCTION, BEFORE_JUNCTION, BEFORE_JUNCTION_FAST = 22.0, 48.0, 75.0  # m with a limit of 30
FREE_FOR_60, FREE_FOR_90 = 36.0, 110.0  # m between those that allow a higher limit
RUN_UP = 36.0  # m of 60 before 90


@dataclass(frozen=True)
class Street:
    """A street from one junction to another."""

    start: str
    end: str
    corners: tuple[tuple[float, float], ...] = ()
    """Points on the way, which are rounded, m."""
    radius: float = CORNER_RADIUS
    """m, of these corners."""
    lanes: int = 1
    """To either side."""

    @property
    def name(self) -> str:
        """That of its junctions."""
        return f"{self.start}{self.end}"


@dataclass(frozen=True)
class Roundabout:
    """A one-way ring, driven counter-clockwise. The light lets the streets in one after the other."""

    center: tuple[float, float]
    """m."""
    radius: float
    """m, of the lane's middle."""
    junctions: tuple[str, ...]
    """Where streets meet the ring, counter-clockwise."""


@dataclass(frozen=True)
class Plan:
    """A town before it is a network."""

    name: str
    junctions: dict[str, tuple[float, float]]
    """Their middles (m) by their names."""
    streets: tuple[Street, ...]
    lane_width: float = LANE_WIDTH
    """m."""
    grain: float = 1.0
    """m from one point of a bend to the next, at most."""
    roundabouts: tuple[Roundabout, ...] = ()
    unlit: frozenset[str] = frozenset()
    """Junctions without lights."""


TOWN01 = Plan(
    "town01",
    {
        "A": (130, 0), "B": (130, 330), "C": (0, 140), "D": (130, 140), "E": (0, 240), "F": (130, 240),
        "G": (130, 90), "H": (400, 90), "I": (270, 0), "J": (270, 90), "K": (210, 90), "L": (210, 330),
    },
    (
        Street("C", "A", ((0, 0),)), Street("A", "I"), Street("I", "H", ((400, 0),)), Street("H", "L", ((400, 330),)),
        Street("L", "B"), Street("B", "E", ((0, 330),)), Street("E", "C"), Street("A", "G"), Street("G", "D"),
        Street("D", "F"), Street("F", "B"), Street("C", "D"), Street("E", "F"), Street("G", "K"), Street("K", "J"),
        Street("J", "H"), Street("I", "J"), Street("K", "L"),
    ),
)  # fmt: skip
TOWN02 = Plan(
    "town02",
    {
        "A": (90, 0), "B": (90, 200), "C": (0, 65), "D": (90, 65), "E": (90, 125), "F": (200, 125),
        "G": (145, 125), "H": (145, 200),
    },
    (
        Street("C", "A", ((0, 0),)), Street("A", "F", ((200, 0),)), Street("F", "H", ((200, 200),)), Street("H", "B"),
        Street("B", "C", ((0, 200),)), Street("A", "D"), Street("D", "E"), Street("E", "B"), Street("C", "D"),
        Street("E", "G"), Street("G", "F"), Street("G", "H"),
    ),
)  # fmt: skip
PLANS = {plan.name: plan for plan in (TOWN01, TOWN02)}


def rounded(points: Points, radius: float, grain: float = 1.0) -> tuple[Points, list[tuple[float, float]]]:
    """A polyline (N, 2) with its corners rounded by a radius in m, and the stretches (from, to) in m along it that
    bend. grain: m from one point of a bend to the next, at most."""
    line, bends, travelled = [points[0]], [], 0.0
    for before, corner, after in zip(points[:-2], points[1:-1], points[2:], strict=True):
        u, v = (p / np.linalg.norm(p) for p in (before - corner, after - corner))
        half = math.acos(float(np.clip(u @ v, -1, 1))) / 2
        center = corner + (u + v) / np.linalg.norm(u + v) * radius / math.sin(half)
        first = corner + u * radius / math.tan(half)
        arm = first - center
        sweep = math.copysign(math.pi - 2 * half, float(u[1] * v[0] - u[0] * v[1]))
        travelled += float(np.linalg.norm(first - line[-1]))
        bends.append((travelled, travelled + radius * abs(sweep)))
        travelled = bends[-1][1]
        for angle in np.linspace(0, sweep, max(2, math.ceil(radius * abs(sweep) / grain)) + 1):
            c, s = math.cos(angle), math.sin(angle)
            line.append(center + np.array([c * arm[0] - s * arm[1], s * arm[0] + c * arm[1]]))
    return np.array([*line, points[-1]]), bends


def limits(length: float, bends: list[tuple[float, float]]) -> list[tuple[float, int]]:
    """Where which limit starts along a street in the direction of travel: (m, km/h), the first at 0.

    length in m; bends: stretches (from, to) in m.
    """
    profile: list[tuple[float, int]] = [(0.0, 30)]
    starts = [0.0] + [end for _, end in bends]
    ends = [begin for begin, _ in bends] + [length]
    for start, end in zip(starts, ends, strict=True):
        free = end - BEFORE_JUNCTION - (start + AFTER_JUNCTION)
        if free < FREE_FOR_60:
            continue
        profile.append((start + AFTER_JUNCTION, 60))
        if free >= FREE_FOR_90:
            profile.append((start + AFTER_JUNCTION + RUN_UP, 90))
        profile.append((end - (BEFORE_JUNCTION_FAST if free >= FREE_FOR_90 else BEFORE_JUNCTION), 30))
    return profile


if __name__ == "__main__":
    from caldrive.world.roads.plan_network import network_of

    for plan in PLANS.values():
        write_whole(Path(__file__).parent / "data" / f"{plan.name}.net.xml", network_of(plan))
