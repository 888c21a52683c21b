"""Writes a town as an OpenDRIVE map, for CARLA's client and other programs (ASAM OpenDRIVE 1.8, in the words of 1.4).

OpenDRIVE's axes are ours, x to the east and y to the north; CARLA's client turns y around when it reads the map. As
there, `hOffset` is the heading of the traffic that a signal is for, seen from the reference line.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import count
from xml.etree import ElementTree as ET

from caldrive.datatypes import Pose
from caldrive.world.roads.network import SIDEWALK_WIDTH, LightPost, RoadNetwork
from caldrive.world.roads.opendrive_roads import Contact, OpenDriveNetwork, OpenDriveRoad, Side, opendrive_roads
from caldrive.world.roads.rounded_line import Piece
from caldrive.world.scene.ground import SOLID_NEAR_JUNCTION

GEO_REFERENCE = "+proj=tmerc +lat_0=0 +lon_0=0 +k=1 +x_0=0 +y_0=0 +datum=WGS84 +units=m +vunits=m +no_defs"
MARK_WIDTH = 0.15  # m
LIGHT, SPEED_SIGN = "1000001", "274"  # OpenDRIVE's number of a light with three lamps, Germany's of a speed sign


@dataclass(frozen=True)
class Signal:
    """A light or a speed sign on the map."""

    id: str
    road: int
    s: float
    """m along the reference line."""
    t: float
    """m to its left."""
    lanes: tuple[int, int]
    """The first and the last lane that it is for."""
    posts: tuple[LightPost, ...] = ()
    """The lights that are this one."""
    limit: int = 0
    """km/h on a speed sign."""


def write_opendrive(roads: RoadNetwork) -> bytes:
    """A town as an OpenDRIVE map; the same town gives the same bytes. Raises ValueError for a town with hills."""
    network = opendrive_roads(roads)
    signals = signals_of(roads, network)
    root = ET.Element("OpenDRIVE")
    header = ET.SubElement(root, "header", revMajor="1", revMinor="4", name=roads.name, version="1", vendor="caldrive")
    x0, y0, x1, y1 = roads.bounds
    for side, bound in (("north", y1), ("south", y0), ("east", x1), ("west", x0)):
        header.set(side, _text(bound))
    ET.SubElement(header, "geoReference").text = GEO_REFERENCE
    for road in (*network.streets, *network.connecting):
        _add_road(root, road, [signal for signal in signals if signal.road == road.id])
    controllers = _add_controllers(root, roads, signals)
    for name, id in network.junctions.items():
        _add_junction(root, network, id, name, controllers)
    ET.indent(root, " ")
    return ET.tostring(root, encoding="utf-8", xml_declaration=True)


def signals_of(roads: RoadNetwork, network: OpenDriveNetwork) -> tuple[Signal, ...]:
    """The lights and signs of a town, numbered after all roads: one for each post, whose lanes have it in common."""
    ids = count(len(network.streets) + len(network.junctions) + len(network.connecting))
    lights = defaultdict[tuple[Pose, str], list[LightPost]](list)
    for post in roads.posts:
        lights[post.stands_at, post.approach[1]].append(post)
    signals = []
    for (foot, _), posts in lights.items():
        numbers = [network.places[post.lane][1] for post in posts]
        signals.append(_signal(network, next(ids), foot, posts[0].lane, (min(numbers), max(numbers)), posts=tuple(posts)))
    for foot, limit in dict.fromkeys((sign.stands_at, sign.limit) for sign in roads.signs):
        lane, _ = roads.lane_at(foot)
        road = network.streets[network.places[lane.id][0]]
        lanes = (-len(road.right.widths), -1) if network.places[lane.id][1] < 0 else (1, len(road.left.widths))
        signals.append(_signal(network, next(ids), foot, lane.id, lanes, limit=limit))
    return tuple(signals)


def _signal(network, id, foot, lane, lanes, **what) -> Signal:
    road = network.streets[network.places[lane][0]]
    place = road.line.project(foot.x, foot.y)
    return Signal(str(id), road.id, place.s, place.left, lanes, **what)


def _text(number: float) -> str:
    """A number to the micrometre, or the millionth."""
    return f"{round(number, 6) + 0.0:g}" if False else repr(round(float(number), 6) + 0.0)


def _add_road(root: ET.Element, road: OpenDriveRoad, signals: Sequence[Signal]) -> None:
    pieces = road.pieces()
    length = sum(piece.length for piece in pieces)
    scale = length / road.line.length
    junction = "-1" if road.junction is None else str(road.junction)
    name = road.right.edges[0][0].edge
    element = ET.SubElement(root, "road", name=name, length=_text(length), id=str(road.id), junction=junction)
    link = ET.SubElement(element, "link")
    for kind, end in zip(("predecessor", "successor"), road.ends, strict=True):
        if isinstance(end, Contact):
            at = "end" if end.at_end else "start"
            ET.SubElement(link, kind, elementType="road", elementId=str(end.road), contactPoint=at)
        elif end is not None:
            ET.SubElement(link, kind, elementType="junction", elementId=str(end))
    ET.SubElement(element, "type", s="0", type="town")
    plan, s = ET.SubElement(element, "planView"), 0.0
    for piece in pieces:
        _add_piece(plan, piece, s)
        s += piece.length
    profile = ET.SubElement(element, "elevationProfile")
    ET.SubElement(profile, "elevation", s="0", a="0", b="0", c="0", d="0")
    _add_lanes(element, road, scale)
    listed = ET.SubElement(element, "signals")
    for signal in signals:
        _add_signal(listed, signal, scale)


def _add_piece(plan: ET.Element, piece: Piece, s: float) -> None:
    start, length = piece.start, _text(piece.length)
    geometry = ET.SubElement(
        plan, "geometry", s=_text(s), x=_text(start.x), y=_text(start.y), hdg=_text(start.heading), length=length
    )
    if piece.cubic is None:
        ET.SubElement(geometry, "line")
    else:
        (u, v), names = piece.cubic.T, "abcd"
        terms = {f"{n}{axis}": _text(c) for axis, cs in (("U", u), ("V", v)) for n, c in zip(names, cs, strict=True)}
        ET.SubElement(geometry, "paramPoly3", terms | {"pRange": "normalized"})


def _add_lanes(element: ET.Element, road: OpenDriveRoad, scale: float) -> None:
    lanes = ET.SubElement(element, "lanes")
    ET.SubElement(lanes, "laneOffset", s="0", a=_text(road.offset), b="0", c="0", d="0")
    section = ET.SubElement(lanes, "laneSection", s="0")
    length = road.line.length * scale
    for name, sign, side in (("left", 1, road.left), ("center", 0, None), ("right", -1, road.right)):
        if side is None:
            center = ET.SubElement(ET.SubElement(section, name), "lane", id="0", type="none", level="false")
            _add_marks(center, _center_marks(road, length))
            continue
        if not side.widths and not side.sidewalk:
            continue
        group = ET.SubElement(section, name)
        numbers = [sign * (k + 1) for k in range(len(side.widths) + side.sidewalk)]
        for number in sorted(numbers, reverse=True):
            _add_lane(group, road, side, number, scale)


def _add_lane(group, road, side, number, scale) -> None:
    k = abs(number) - 1
    walk = k == len(side.widths)
    lane = ET.SubElement(group, "lane", id=str(number), type="sidewalk" if walk else "driving", level="false")
    link = ET.SubElement(lane, "link")
    for kind, end in zip(("predecessor", "successor"), road.ends, strict=True):
        if isinstance(end, Contact) and number in end.lanes:
            ET.SubElement(link, kind, id=str(end.lanes[number]))
    width = SIDEWALK_WIDTH if walk else side.widths[k]
    ET.SubElement(lane, "width", sOffset="0", a=_text(width), b="0", c="0", d="0")
    if walk or road.junction is not None:
        kind = "none"
    else:
        kind = "solid" if k == len(side.widths) - 1 else "broken"
    _add_marks(lane, [(0.0, kind, "white", "both" if kind == "broken" else "none")])
    if not walk:
        for at, limit in _limits(road, side, k, number < 0, scale):
            ET.SubElement(lane, "speed", sOffset=_text(at), max=_text(limit), unit="km/h")


def _limits(road, side, k, ahead, scale) -> list[tuple[float, float]]:
    """Where which limit begins along the reference line: (m, km/h)."""
    edges = side.edges if ahead else side.edges[::-1]
    found: list[tuple[float, float]] = []
    for edge in edges:
        lane = edge[k]
        first = lane.line.points[0 if ahead else -1]
        s = road.line.project(*first).s * scale if found else 0.0
        limit = round(lane.limit, 1)
        if not found or found[-1][1] != limit:
            found.append((s, limit))
    return found


def _center_marks(road, length) -> list[tuple[float, str, str, str]]:
    if road.junction is not None:
        return [(0.0, "none", "white", "none")]
    if not road.left.widths:
        return [(0.0, "solid", "white", "none")]
    zone = min(SOLID_NEAR_JUNCTION, length / 2)
    kinds = [(0.0, "solid"), (zone, "broken"), (length - zone, "solid")]
    return [(s, kind, "yellow", "none") for s, kind in kinds]


def _add_marks(lane, marks) -> None:
    for s, kind, color, change in marks:
        ET.SubElement(
            lane, "roadMark", sOffset=_text(s), type=kind, weight="standard", material="standard", color=color,
            width=_text(MARK_WIDTH if kind != "none" else 0.0), laneChange=change,
        )  # fmt: skip


def _add_signal(listed, signal: Signal, scale: float) -> None:
    ahead = signal.lanes[0] < 0
    name = f"Speed_{signal.limit}" if signal.limit else "Signal_3Light_Post01"
    element = ET.SubElement(
        listed, "signal", name=name, id=signal.id, s=_text(signal.s * scale), t=_text(signal.t), zOffset="0",
        hOffset=_text(0.0 if ahead else math.pi), orientation="+" if ahead else "-",
        dynamic="no" if signal.limit else "yes", country="DE" if signal.limit else "OpenDRIVE",
        type=SPEED_SIGN if signal.limit else LIGHT, subtype=str(signal.limit or -1), value=str(signal.limit or -1),
        unit="km/h", text="", height="1", width="0.5",
    )  # fmt: skip
    ET.SubElement(element, "validity", fromLane=str(signal.lanes[0]), toLane=str(signal.lanes[1]))


def _add_controllers(root, roads, signals) -> dict[str, list[str]]:
    """Lights that are green together; by the name of the SUMO junction their road leads into."""
    groups = defaultdict[tuple[str, str], list[str]](list)
    for signal in signals:
        if signal.posts:
            groups[signal.posts[0].approach].append(signal.id)
    ids = count(1 + max((int(signal.id) for signal in signals), default=0))
    by_junction = defaultdict[str, list[str]](list)
    for (light, _), members in groups.items():
        id = str(next(ids))
        controller = ET.SubElement(root, "controller", name=f"{light}", id=id, sequence="0")
        for member in members:
            ET.SubElement(controller, "control", signalId=member, type="0")
        by_junction[light].append(id)
    return by_junction


def _add_junction(root, network, id, name, controllers) -> None:
    junction = ET.SubElement(root, "junction", id=str(id), name=name)
    n = count()
    for road in network.connecting:
        if road.junction == id:
            before = road.ends[0]
            connection = ET.SubElement(
                junction, "connection", id=str(next(n)), incomingRoad=str(before.road), connectingRoad=str(road.id),
                contactPoint="start",
            )  # fmt: skip
            for own, theirs in sorted(before.lanes.items(), reverse=True):
                ET.SubElement(connection, "laneLink", {"from": str(theirs), "to": str(own)})
    for k, controller in enumerate(controllers.get(name, [])):
        ET.SubElement(junction, "controller", id=controller, type="0", sequence=str(k))
