"""The plans of the package's own towns, and how they become SUMO networks.

A plan is a handful of T-junctions joined by streets. Limits follow one rule: 30 around junctions and corners, 60 where
the free stretch allows it, 90 on the longest ones. `python -m caldrive.world.roads.plans` writes the shipped networks.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np

from caldrive.datatypes import KMH, Points
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


@dataclass(frozen=True)
class Plan:
    """A town before it is a network."""

    name: str
    junctions: dict[str, tuple[float, float]]
    """Their middles (m) by their names."""
    streets: tuple[Street, ...]


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


def rounded(points: Points, radius: float) -> tuple[Points, list[tuple[float, float]]]:
    """A polyline (N, 2) with its corners rounded by a radius in m, and the stretches (from, to) in m along it that
    bend."""
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
        for angle in np.linspace(0, sweep, max(2, math.ceil(radius * abs(sweep) / 1.0)) + 1):
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


def _limit_at(profile: list[tuple[float, int]], s: float) -> int:
    return [limit for start, limit in profile if start <= s + 0.02][-1]


def _cut(line: Points, start: float, end: float) -> Points:
    """The part of a polyline between two arc lengths."""
    s = np.concatenate(([0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))))
    inner = s[(s > start + 1e-6) & (s < end - 1e-6)]
    at = np.concatenate(([start], inner, [end]))
    return np.stack((np.interp(at, s, line[:, 0]), np.interp(at, s, line[:, 1])), axis=1)


def _add_street(nodes: ET.Element, edges: ET.Element, plan: Plan, street: Street) -> None:
    corners = [plan.junctions[street.start], *street.corners, plan.junctions[street.end]]
    line, bends = rounded(np.array(corners, dtype=float), CORNER_RADIUS)
    length = float(np.linalg.norm(np.diff(line, axis=0), axis=1).sum())
    ahead = limits(length, bends)
    back = limits(length, [(length - end, length - begin) for begin, end in reversed(bends)])
    cuts = sorted({round(s, 2) for s, _ in ahead} | {round(length - s, 2) for s, _ in back} | {0.0, round(length, 2)})
    cuts = [c for i, c in enumerate(cuts) if i == 0 or c - cuts[i - 1] > 1.0]
    cuts[-1] = length
    name = f"{street.start}{street.end}"
    ids = [street.start, *(f"{name}{i}" for i in range(1, len(cuts) - 1)), street.end]
    for node, s in list(zip(ids, cuts, strict=True))[1:-1]:
        x, y = _cut(line, 0, s)[-1]
        ET.SubElement(nodes, "node", id=node, x=f"{x:.3f}", y=f"{y:.3f}", type="priority", radius="0.1")
    for i, (start, end) in enumerate(itertools.pairwise(cuts)):
        shape = _cut(line, start, end)
        forward, backward = _limit_at(ahead, start), _limit_at(back, length - end)
        _add_edge(edges, f"{name}{i}", ids[i], ids[i + 1], shape, forward)
        _add_edge(edges, f"-{name}{i}", ids[i + 1], ids[i], shape[::-1], backward)


def _add_edge(edges: ET.Element, name: str, start: str, end: str, shape: Points, limit: int) -> None:
    ET.SubElement(
        edges, "edge", {
            "id": name, "from": start, "to": end, "numLanes": "1", "width": f"{LANE_WIDTH}",
            "speed": f"{limit * KMH:.4f}", "shape": " ".join(f"{x:.3f},{y:.3f}" for x, y in shape),
        },
    )  # fmt: skip


def network_of(plan: Plan) -> bytes:
    """A plan as a SUMO network. Needs netconvert (the extra `opendrive`)."""
    from caldrive.world.roads.netconvert import run_netconvert

    nodes, edges = ET.Element("nodes"), ET.Element("edges")
    for name, (x, y) in plan.junctions.items():
        ET.SubElement(nodes, "node", id=name, x=str(x), y=str(y), type="traffic_light", radius="7")
    for street in plan.streets:
        _add_street(nodes, edges, plan, street)
    inputs = {"node-files": ET.tostring(nodes), "edge-files": ET.tostring(edges)}
    return run_netconvert(inputs, ["--offset.disable-normalization"])


if __name__ == "__main__":
    for plan in PLANS.values():
        write_whole(Path(__file__).parent / "data" / f"{plan.name}.net.xml", network_of(plan))
