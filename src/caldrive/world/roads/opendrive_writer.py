"""Writes a town as an OpenDRIVE map, for CARLA's client and other programs (ASAM OpenDRIVE, in the words of 1.4).

OpenDRIVE's axes are ours, x to the east and y to the north; CARLA's client turns y around as it reads the map. Where
programs differ, what CARLA's maps say counts: `hOffset` is the heading of the traffic that a signal is for, seen from
the reference line, and `zOffset` the ground.
"""

from __future__ import annotations

from collections.abc import Sequence
from xml.etree import ElementTree as ET

from caldrive.world.roads.network import SIDEWALK_WIDTH, RoadNetwork
from caldrive.world.roads.opendrive_roads import Contact, OpenDriveNetwork, OpenDriveRoad, opendrive_roads
from caldrive.world.roads.rounded_line import Piece
from caldrive.world.roads.written_signals import add_controllers, add_signals, signals_of
from caldrive.world.scene.ground import SOLID_NEAR_JUNCTION

GEO_REFERENCE = "+proj=tmerc +lat_0=0 +lon_0=0 +k=1 +x_0=0 +y_0=0 +datum=WGS84 +units=m +vunits=m +no_defs"
MARK_WIDTH = 0.2  # m


def write_opendrive(roads: RoadNetwork) -> bytes:
    """A town as an OpenDRIVE map; the same town gives the same bytes. Raises ValueError for a town with hills."""
    network = opendrive_roads(roads)
    signals = signals_of(roads, network)
    root = ET.Element("OpenDRIVE")
    west, south, east, north = map(_text, roads.bounds)
    header = ET.SubElement(
        root, "header", revMajor="1", revMinor="4", name=roads.name, version="1", vendor="caldrive", north=north,
        south=south, east=east, west=west,
    )  # fmt: skip
    ET.SubElement(header, "geoReference").text = GEO_REFERENCE
    for road in (*network.streets, *network.connecting):
        element = _add_road(root, road)
        add_signals(element, [signal for signal in signals if signal.road == road.id])
    controllers = add_controllers(root, network, signals)
    for name, id in network.junctions.items():
        _add_junction(root, network, name, controllers.get(id, []))
    ET.indent(root, "")
    return bytes(ET.tostring(root, encoding="utf-8", xml_declaration=True))


def _text(number: float) -> str:
    """A number to the micrometre."""
    return f"{number:.6f}".rstrip("0").rstrip(".")


def _add_road(root: ET.Element, road: OpenDriveRoad) -> ET.Element:
    junction = "-1" if road.junction is None else str(road.junction)
    name = road.right.edges[0][0].edge
    element = ET.SubElement(root, "road", name=name, length=_text(road.length), id=str(road.id), junction=junction)
    link = ET.SubElement(element, "link")
    for kind, end in zip(("predecessor", "successor"), road.ends, strict=True):
        if isinstance(end, Contact):
            at = "end" if end.at_end else "start"
            ET.SubElement(link, kind, elementType="road", elementId=str(end.road), contactPoint=at)
        elif end is not None:
            ET.SubElement(link, kind, elementType="junction", elementId=str(end))
    ET.SubElement(element, "type", s="0", type="town")
    plan, s = ET.SubElement(element, "planView"), 0.0
    for piece in road.pieces:
        _add_piece(plan, piece, s)
        s += piece.length
    ET.SubElement(ET.SubElement(element, "elevationProfile"), "elevation", s="0", a="0", b="0", c="0", d="0")
    _add_lanes(element, road)
    return element


def _add_piece(plan: ET.Element, piece: Piece, s: float) -> None:
    x, y, heading, length = map(_text, (piece.start.x, piece.start.y, piece.start.heading, piece.length))
    geometry = ET.SubElement(plan, "geometry", s=_text(s), x=x, y=y, hdg=heading, length=length)
    if piece.cubic is None:
        ET.SubElement(geometry, "line")
    else:
        curve = ET.SubElement(geometry, "paramPoly3", pRange="normalized")
        for axis, terms in zip("UV", piece.cubic.T, strict=True):
            for name, term in zip("abcd", terms, strict=True):
                curve.set(f"{name}{axis}", _text(term))


def _add_lanes(element: ET.Element, road: OpenDriveRoad) -> None:
    """One lane section: along a street nothing but the limit changes."""
    lanes = ET.SubElement(element, "lanes")
    ET.SubElement(lanes, "laneOffset", s="0", a=_text(road.offset), b="0", c="0", d="0")
    section = ET.SubElement(lanes, "laneSection", s="0")
    left, right = ([*range(1, len(side.widths) + side.sidewalk + 1)] for side in (road.left, road.right))
    if left:
        group = ET.SubElement(section, "left")
        for k in reversed(left):
            _add_lane(group, road, k)
    center = ET.SubElement(ET.SubElement(section, "center"), "lane", id="0", type="none", level="false")
    _add_center_marks(center, road)
    group = ET.SubElement(section, "right")
    for k in right:
        _add_lane(group, road, -k)


def _add_lane(group: ET.Element, road: OpenDriveRoad, number: int) -> None:
    """A lane for cars, or beyond these the sidewalk."""
    side = road.right if number < 0 else road.left
    is_sidewalk = abs(number) > len(side.widths)
    kind, width = ("sidewalk", SIDEWALK_WIDTH) if is_sidewalk else ("driving", side.widths[abs(number) - 1])
    lane = ET.SubElement(group, "lane", id=str(number), type=kind, level="false")
    link = ET.SubElement(lane, "link")
    for name, end in zip(("predecessor", "successor"), road.ends, strict=True):
        if isinstance(end, Contact) and number in end.lanes:
            ET.SubElement(link, name, id=str(end.lanes[number]))
    ET.SubElement(lane, "width", sOffset="0", a=_text(width), b="0", c="0", d="0")
    if is_sidewalk or road.junction is not None:
        _add_mark(lane, 0.0, "none")
    elif abs(number) == len(side.widths):
        _add_mark(lane, 0.0, "solid")
    else:
        _add_mark(lane, 0.0, "broken", change="both")
    if not is_sidewalk:
        _add_limits(lane, road, number)


def _add_limits(lane: ET.Element, road: OpenDriveRoad, number: int) -> None:
    """The limits of a lane by where they begin along the reference line."""
    edges = road.right.edges if number < 0 else road.left.edges[::-1]
    before, s = None, 0.0
    for edge in edges:
        part = edge[abs(number) - 1]
        limit = _text(round(part.limit, 1))  # SUMO keeps m/s to the centimetre: 60.001 km/h
        if limit != before:
            ET.SubElement(lane, "speed", sOffset=_text(s), max=limit, unit="km/h")
        before = limit
        s, _ = road.locate(*part.line.points[-1 if number < 0 else 0])


def _add_center_marks(lane: ET.Element, road: OpenDriveRoad) -> None:
    """What parts the directions, as the town is painted; nobody changes lanes over it."""
    if road.junction is not None:
        _add_mark(lane, 0.0, "none")
    elif not road.left.widths:
        _add_mark(lane, 0.0, "solid")
    else:
        zone = min(SOLID_NEAR_JUNCTION, road.length / 2)
        for s, kind in ((0.0, "solid"), (zone, "broken"), (road.length - zone, "solid")):
            _add_mark(lane, s, kind, color="yellow")


def _add_mark(lane: ET.Element, s: float, kind: str, *, color: str = "white", change: str = "none") -> None:
    ET.SubElement(
        lane, "roadMark", sOffset=_text(s), type=kind, weight="standard", material="standard", color=color,
        width=_text(MARK_WIDTH), laneChange=change,
    )  # fmt: skip


def _add_junction(root: ET.Element, network: OpenDriveNetwork, name: str, controllers: Sequence[str]) -> None:
    id = network.junctions[name]
    junction = ET.SubElement(root, "junction", id=str(id), name=name)
    roads = [road for road in network.connecting if road.junction == id]
    for k, road in enumerate(roads):
        start = road.ends[0]
        assert isinstance(start, Contact)
        connection = ET.SubElement(
            junction, "connection", id=str(k), incomingRoad=str(start.road), connectingRoad=str(road.id),
            contactPoint="start",
        )  # fmt: skip
        for own, incoming in sorted(start.lanes.items(), reverse=True):
            ET.SubElement(connection, "laneLink", {"from": str(incoming), "to": str(own)})
    for k, controller in enumerate(controllers):
        ET.SubElement(junction, "controller", id=controller, type="0", sequence=str(k))
