"""Reads a SUMO network: lanes with their successors, turns and lights, and where posts and signs stand."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import sumolib

from caldrive.datatypes import Command, Points, Pose, Sign
from caldrive.geometry import Polyline
from caldrive.world.roads.network import Lane, LightPost, RoadNetwork

SHORTEST_LANE = 1e-3  # m; shorter ones only join others
BROADEST = 50.0  # m, of a lane
FARTHEST, WIDEST, LONGEST = 10_000, 30, 300  # km: from the origin, from side to side, all lanes together
AFTER_LIMIT_CHANGE = 2.0  # m behind which the sign stands
SHARED_POST = 0.5  # m from the kerb to a post that several lanes share
SIGN_SHARE, SIGN_LEAST = 0.4, 40.0  # where on a street after a junction its sign stands, and how long (m) it must be
_TURNS = {"l": Command.LEFT, "L": Command.LEFT, "r": Command.RIGHT, "R": Command.RIGHT, "s": Command.STRAIGHT}


def read_roads(name: str, network: Path, appearance: str) -> RoadNetwork:
    """Reads a SUMO network, with lights and signs where our towns have them.

    Raises ValueError with the reason where it has no lane to drive on.
    """
    net = sumolib.net.readNet(str(network), withInternal=True)
    lanes = _join(net, _read_lanes(net))
    _require_town(lanes)
    return RoadNetwork(
        name, network, appearance, lanes=lanes, posts=_read_posts(net, lanes), signs=signs_at_limit_changes(lanes)
    )


def _require_town(lanes: dict[str, Lane]) -> None:
    """Raises ValueError with the reason where lanes are none to drive on, or more than memory holds."""
    if all(lane.internal for lane in lanes.values()):
        raise ValueError("it has no lane of type driving that is longer than a millimetre")
    for lane in lanes.values():
        if not 0 < lane.width <= BROADEST:
            raise ValueError(f"its lane {lane.id} is {lane.width:g} m wide")
    points = np.concatenate([lane.line.points for lane in lanes.values()])
    if np.abs(points).max() > FARTHEST * 1000:
        raise ValueError(f"it has roads more than {FARTHEST} km from its origin")
    for what, km, most in (
        ("reaches over", float(np.ptp(points, axis=0).max()) / 1000, WIDEST),
        ("has lanes of", sum(lane.line.length for lane in lanes.values()) / 1000, LONGEST),
    ):
        if km > most:
            raise ValueError(f"it {what} {km:.0f} km, more than {most}: cut a smaller part out of it")


def _allows_cars(lane: sumolib.net.lane.Lane) -> bool:
    return bool(lane.allows("passenger"))


def _read_lanes(net: sumolib.net.Net) -> dict[str, Lane]:
    """Lanes for cars by their ids, without what joins them."""
    lanes: dict[str, Lane] = {}
    for edge in net.getEdges(withInternal=True):
        for raw in edge.getLanes():
            points, heights = np.array(raw.getShape())[:, :2], [place[2] for place in raw.getShape3D()]
            if not _allows_cars(raw) or not _is_line(points):
                continue
            line = Polyline(points)
            lanes[raw.getID()] = Lane(
                id=raw.getID(),
                line=line,
                width=raw.getWidth(),
                limit=raw.getSpeed() * 3.6,
                internal=edge.getFunction() == "internal",
                heights=np.array(heights)[line.kept] if any(heights) else None,
            )
    return lanes


def _is_line(points: Points) -> bool:
    """Whether points (N, 2) are more than one place, and no infinite ones."""
    length = np.linalg.norm(np.diff(points, axis=0), axis=1).sum()
    return bool(np.isfinite(length) and length >= SHORTEST_LANE)


def _turn(net: sumolib.net.Net, connection: sumolib.net.connection.Connection, *, forks: bool) -> Command | None:
    """The command that leads along a connection; None where there is no choice. Right leads into a roundabout and out
    of it, straight on around it."""
    junction = connection.getJunction()
    ring = next((ring for ring in net.getRoundabouts() if junction.getID() in ring.getNodes()), None)
    if ring is not None:
        stays = {connection.getFrom().getID(), connection.getTo().getID()} <= set(ring.getEdges())
        return Command.STRAIGHT if stays else Command.RIGHT
    return _TURNS.get(connection.getDirection()) if forks or _is_junction(junction) else None


def _is_junction(node: sumolib.net.node.Node) -> bool:
    """Whether a node is a true junction: cars come in from more than two sides."""
    incoming = (edge for edge in node.getIncoming() if edge.getFunction() != "internal")
    return sum(any(map(_allows_cars, edge.getLanes())) for edge in incoming) > 2


def _join(net: sumolib.net.Net, lanes: dict[str, Lane]) -> dict[str, Lane]:
    """Adds successors, turns and lights to bare lanes."""
    joined = {}
    turns: dict[str, tuple[Command | None, tuple[str, int] | None]] = {}
    for lane in lanes.values():
        onward = [c for c in net.getLane(lane.id).getOutgoing() if c.getToLane().getID() in lanes]
        forks = len({c.getTo().getID() for c in onward}) > 1
        successors = tuple(c.getViaLaneID() if c.getViaLaneID() in lanes else c.getToLane().getID() for c in onward)
        joined[lane.id] = replace(lane, successors=successors)
        for connection, via in zip(onward, successors, strict=True):
            if lane.internal:
                if lanes[via].internal:
                    turns.setdefault(via, (None, None))
                continue
            turn = _turn(net, connection, forks=forks)
            light = (connection.getTLSID(), connection.getTLLinkIndex()) if connection.getTLSID() else None
            turns[via] = turn, light
    for via, (turn, light) in turns.items():
        if joined[via].internal:
            joined[via] = replace(joined[via], turn=turn, light=light)
    return joined


def _sides(lanes: dict[str, Lane]) -> dict[str, list[Lane]]:
    """The lanes outside junctions by their edges: those side by side that lead the same way, the rightmost first."""
    sides = defaultdict[str, list[Lane]](list)
    for lane in lanes.values():
        if not lane.internal:
            sides[lane.edge].append(lane)
    return sides


def _shared_foot(side: Sequence[Lane], s: float) -> Pose | None:
    """Where one post stands for all lanes of a side, None for one lane: nearer to the kerb than beside that, as the
    leftmost lane must have it in its area A1, too."""
    return side[0].post_beside(s, away=SHARED_POST) if len(side) > 1 else None


def _read_posts(net: sumolib.net.Net, lanes: dict[str, Lane]) -> tuple[LightPost, ...]:
    """A light for each lane that leads into a junction with lights, at its stop line."""
    posts, sides = [], _sides(lanes)
    for lane in lanes.values():
        links = [c for c in net.getLane(lane.id).getOutgoing() if c.getTLSID()]
        if lane.internal or not links or net.getEdge(links[0].getFrom().getID()).getToNode().getType() == "dead_end":
            continue
        indices = tuple(sorted(c.getTLLinkIndex() for c in links))
        end = lane.line.length
        posts.append(
            LightPost(
                links[0].getTLSID(), lane.id, links=indices, pose=lane.post_beside(end), stop_line=lane.stop_line,
                foot=_shared_foot(sides[lane.edge], sides[lane.edge][0].line.length),
            )
        )  # fmt: skip
    return tuple(posts)


def signs_at_limit_changes(lanes: dict[str, Lane]) -> tuple[Sign, ...]:
    """A sign where the limit changes, and one along each street after a junction."""
    signs = []
    before = {successor: lane for lane in lanes.values() for successor in lane.successors}
    for side in _sides(lanes).values():
        lane = side[0]
        via = before.get(lane.id)
        previous = before.get(via.id) if via is not None and via.internal else via
        limit = round(lane.limit)
        after_junction = via is None or via.turn is not None
        if previous is not None and not after_junction and round(previous.limit) != limit:
            at = AFTER_LIMIT_CHANGE
        elif after_junction and lane.line.length > SIGN_LEAST:
            at = lane.line.length * SIGN_SHARE
        else:
            continue
        signs += [Sign(each.post_beside(at), limit, _shared_foot(side, at)) for each in side]
    return tuple(signs)
