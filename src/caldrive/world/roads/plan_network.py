"""How a plan becomes a SUMO network: its nodes, edges and connections, passed through netconvert."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from xml.etree import ElementTree as ET

import numpy as np

from caldrive.datatypes import KMH, Points
from caldrive.world.roads.plans import Plan, Roundabout, Street, limits, rounded

KERB_RADIUS = {1: 7.0, 2: 5.0}  # m, of the kerbs at a junction's corners, by the lanes a side of its broadest street
RING_KERB_RADIUS = 4.0  # m, where a street meets a roundabout
RING_LIMIT = 30  # km/h


def network_of(plan: Plan, options: Sequence[str] = ()) -> bytes:
    """A plan as a SUMO network. options: for netconvert, in place of the usual ones. Needs the extra `opendrive`."""
    from caldrive.world.roads.netconvert import run_netconvert

    return run_netconvert(plain_network(plan), ["--offset.disable-normalization", *options])


def plain_network(plan: Plan) -> dict[str, bytes]:
    """What netconvert makes the network of, by the options that name it."""
    nodes, edges = ET.Element("nodes"), ET.Element("edges")
    for name in plan.junctions:
        _add_junction(nodes, plan, name)
    for street in plan.streets:
        _add_street(nodes, edges, plan, street)
    inputs = {}
    if plan.roundabouts:
        for ring in plan.roundabouts:
            _add_ring(edges, plan, ring)
        inputs["connection-files"] = ET.tostring(_ring_connections(edges, plan))
    return inputs | {"node-files": ET.tostring(nodes), "edge-files": ET.tostring(edges)}


def _add_junction(nodes: ET.Element, plan: Plan, name: str) -> None:
    """A junction, most with a light; those around a roundabout share theirs."""
    x, y = plan.junctions[name]
    ring = next((ring for ring in plan.roundabouts if name in ring.junctions), None)
    lanes = max((street.lanes for street in plan.streets if name in (street.start, street.end)), default=1)
    radius = KERB_RADIUS[lanes] if ring is None else RING_KERB_RADIUS
    kind = "priority" if name in plan.unlit else "traffic_light"
    node = ET.SubElement(nodes, "node", id=name, x=str(x), y=str(y), type=kind, radius=f"{radius:g}")
    if ring is not None:
        node.set("tl", ring.junctions[0])


def _limit_at(profile: list[tuple[float, int]], s: float) -> int:
    return [limit for start, limit in profile if start <= s + 0.02][-1]


def _cut(line: Points, start: float, end: float) -> Points:
    """The part of a polyline between two arc lengths."""
    s = np.concatenate(([0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))))
    inner = s[(s > start + 1e-6) & (s < end - 1e-6)]
    at = np.concatenate(([start], inner, [end]))
    return np.stack((np.interp(at, s, line[:, 0]), np.interp(at, s, line[:, 1])), axis=1)


def _add_street(nodes: ET.Element, edges: ET.Element, plan: Plan, street: Street) -> None:
    """The two ways of a street, cut where either limit changes."""
    corners = [plan.junctions[street.start], *street.corners, plan.junctions[street.end]]
    line, bends = rounded(np.array(corners, dtype=float), street.radius, plan.grain)
    length = float(np.linalg.norm(np.diff(line, axis=0), axis=1).sum())
    ahead = limits(length, bends)
    back = limits(length, [(length - end, length - begin) for begin, end in reversed(bends)])
    cuts = sorted({round(s, 2) for s, _ in ahead} | {round(length - s, 2) for s, _ in back} | {0.0, round(length, 2)})
    cuts = [c for i, c in enumerate(cuts) if i == 0 or c - cuts[i - 1] > 1.0]
    cuts[-1] = length
    ids = [street.start, *(f"{street.name}{i}" for i in range(1, len(cuts) - 1)), street.end]
    for node, s in list(zip(ids, cuts, strict=True))[1:-1]:
        x, y = _cut(line, 0, s)[-1]
        ET.SubElement(nodes, "node", id=node, x=f"{x:.3f}", y=f"{y:.3f}", type="priority", radius="0.1")
    broad = {"numLanes": f"{street.lanes}", "width": f"{plan.lane_width}"}
    for i, (start, end) in enumerate(itertools.pairwise(cuts)):
        shape = _cut(line, start, end)
        forward, backward = _limit_at(ahead, start), _limit_at(back, length - end)
        _add_edge(edges, (f"{street.name}{i}", ids[i], ids[i + 1]), shape, forward, broad)
        _add_edge(edges, (f"-{street.name}{i}", ids[i + 1], ids[i]), shape[::-1], backward, broad)


def _add_edge(edges: ET.Element, ends: tuple[str, str, str], shape: Points, limit: int, broad: dict[str, str]) -> None:
    """One way of a street. ends: its id, and the nodes where it starts and ends; broad: its lanes and their width."""
    name, start, end = ends
    ET.SubElement(
        edges, "edge", {
            "id": name, "from": start, "to": end, **broad, "speed": f"{limit * KMH:.4f}",
            "shape": " ".join(f"{x:.3f},{y:.3f}" for x, y in shape),
        },
    )  # fmt: skip


def _add_ring(edges: ET.Element, plan: Plan, ring: Roundabout) -> None:
    """The one-way edges of a roundabout: arcs from each of its junctions to the next."""
    (cx, cy), names = ring.center, ring.junctions
    for start, end in zip(names, (*names[1:], names[0]), strict=True):
        first, last = (math.atan2(plan.junctions[name][1] - cy, plan.junctions[name][0] - cx) for name in (start, end))
        sweep = (last - first) % math.tau
        angles = first + np.linspace(0.0, sweep, math.ceil(ring.radius * sweep / plan.grain) + 1)
        shape = np.stack((cx + ring.radius * np.cos(angles), cy + ring.radius * np.sin(angles)), axis=1)
        broad = {"numLanes": "1", "width": f"{plan.lane_width}", "spreadType": "center"}
        _add_edge(edges, (f"{start}{end}", start, end), shape, RING_LIMIT, broad)


def _ring_connections(edges: ET.Element, plan: Plan) -> ET.Element:
    """What nobody in a roundabout waits for a light on: ways on around it, and out of it."""
    connections = ET.Element("connections")
    for start, end in _ring_ways(edges, plan):
        lanes = {"fromLane": "0", "toLane": "0"}
        ET.SubElement(connections, "connection", {"from": start, "to": end, **lanes, "uncontrolled": "true"})
    return connections


def _ring_ways(edges: ET.Element, plan: Plan) -> Iterator[tuple[str, str]]:
    """The ids of two edges for each such way."""
    for ring in plan.roundabouts:
        for before, name in zip((ring.junctions[-1], *ring.junctions), ring.junctions, strict=False):
            onward = [edge.get("id", "") for edge in edges if edge.get("from") == name]
            yield from ((f"{before}{name}", edge) for edge in onward)
