"""Makes an OpenDRIVE map fit for netconvert: what is odd is put right or left out and counted, the rest is kept.

netconvert gives up over a single missing attribute, knows few kinds of lanes and no <type><speed>, and sums up spirals
for minutes whose ends are nearly equal.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from itertools import pairwise
from xml.etree import ElementTree as ET

from caldrive.datatypes import KMH
from caldrive.geometry import added_up
from caldrive.world.roads.reference_line import curvatures, number, shape_of

CAR_LANES = frozenset({
    "driving", "onRamp", "offRamp", "entry", "exit", "slipLane", "bidirectional", "connectingRamp", "shared",
    "mwyEntry", "mwyExit",
})  # fmt: skip
LONGEST_ROAD = 1e5  # m
STRAIGHT = 1e-3  # m by which a piece of road may be off where an arc is taken as a line, or a spiral as an arc
UNITS = {"m/s": 1.0, "km/h": KMH, "kmh": KMH, "kph": KMH, "mph": 1.609344 * KMH}  # m/s in one
_NUMBERS = {  # that netconvert needs of each element; 0 where they are missing
    "geometry": ("s", "x", "y", "hdg", "length"), "laneSection": ("s",), "poly3": tuple("abcd"),
    "elevation": ("s", *"abcd"), "laneOffset": ("s", *"abcd"), "width": ("sOffset", *"abcd"),
}  # fmt: skip
_UNUSED = ("objects", "signals", "railroad", "surface", "userData", "lateralProfile")  # by netconvert
Dropped = Counter[str]


def mend(root: ET.Element) -> Dropped:
    """Mends a map in place; returns how many of what it left out. Raises ValueError for what no map has."""
    dropped: Dropped = Counter()
    _strip_namespaces(root)
    if root.tag != "OpenDRIVE":
        raise ValueError(f"it is <{root.tag}>, not <OpenDRIVE>")
    for road in root.findall("road"):
        _require_right_hand(road)
        _require_lengths(road)
        if not road.get("id") or road.find("planView/geometry") is None or road.find("lanes/laneSection") is None:
            dropped["roads without a line or lanes"] += 1
            root.remove(road)
            continue
        road.set("junction", road.get("junction") or "-1")
        dropped += _mend_line(road) + _mend_lanes(road)
    return dropped + _mend_links(root) + _mend_junctions(root)


def strip_unused(root: ET.Element) -> None:
    """Removes what netconvert does not need, once it is read: a part of it could still make it fail."""
    for header in root.findall("header"):
        root.remove(header)
    for parent in list(root.iter()):
        for child in [child for child in parent if child.tag in _UNUSED]:
            parent.remove(child)


def _strip_namespaces(root: ET.Element) -> None:
    for element in root.iter():
        element.tag = element.tag.rpartition("}")[2]


def _require_right_hand(road: ET.Element) -> None:
    """Raises ValueError where a road is driven on the left: posts, commands and areas are those of the right."""
    if road.get("rule") == "LHT":
        raise ValueError(
            f'its road {road.get("id")} is driven on the left (rule="LHT"), and only the right is known here'
        )


def _require_lengths(road: ET.Element) -> None:
    """Raises ValueError for a length that no road has: netconvert would work on it for hours."""
    for part in (road, *road.findall("planView/geometry")):
        if not 0 <= number(part, "length") <= LONGEST_ROAD:
            raise ValueError(f"<{part.tag}> of road {road.get('id')} has length={part.get('length')}")


def _mend_line(road: ET.Element) -> Dropped:
    """Gives every piece of a road's line a shape, and everything its numbers."""
    dropped: Dropped = Counter()
    for element in road.iter():
        for name in _NUMBERS.get(element.tag, ()):
            element.set(name, element.get(name) or "0")
    pieces = road.findall("planView/geometry")
    road.set("length", road.get("length") or repr(added_up(number(piece, "length") for piece in pieces)))
    for geometry in pieces:
        shape = shape_of(geometry)
        if shape is None:
            dropped["pieces of road without a shape, which are straight now"] += 1
            shape = ET.Element("line")
        geometry[:] = [_simplest(shape, number(geometry, "length"))]
    return dropped


def _simplest(shape: ET.Element, length: float) -> ET.Element:
    """A spiral as the arc, and an arc as the line, from which nobody could tell it."""
    if shape.tag == "spiral":
        first, last = curvatures(shape)
        if abs(last - first) * length**2 / 12 < STRAIGHT:  # the ends' distance from those of the arc
            shape = ET.Element("arc", curvature=repr((first + last) / 2))
    if shape.tag == "arc" and abs(number(shape, "curvature")) * length**2 / 2 < STRAIGHT:
        return ET.Element("line")
    return shape


def _mend_lanes(road: ET.Element) -> Dropped:
    """Turns types of lanes into those that netconvert is told of, and writes the limits of the road on its lanes."""
    dropped: Dropped = Counter()
    sections = sorted(road.findall("lanes/laneSection"), key=lambda section: number(section, "s"))
    ends = [number(section, "s") for section in sections[1:]] + [number(road, "length")]
    for section, end in zip(sections, ends, strict=True):
        begin = number(section, "s")
        for side in section:
            for lane in side.findall("lane"):
                if not _is_integer(lane.get("id")):
                    dropped["lanes without a number"] += 1
                    side.remove(lane)
                    continue
                lane.attrib.pop("level", None)
                lane.set("type", "driving" if side.tag != "center" and lane.get("type") in CAR_LANES else "none")
                _mend_lane_links(lane)
                _set_speeds(lane, [*_limits(road, begin, end)])
            side[:] = sorted(side.findall("lane"), key=lambda lane: -int(lane.get("id") or 0))  # from left to right
    return dropped


def _mend_lane_links(lane: ET.Element) -> None:
    for link in lane.findall("link"):
        for end in list(link):
            if not _is_integer(end.get("id")):
                link.remove(end)


def _is_integer(text: str | None) -> bool:
    return (text or "").lstrip("+-").isdecimal()


def speed(element: ET.Element, usual_unit: str = "m/s") -> float | None:
    """The limit that a <speed> tells in m/s, None where it tells none that is a number."""
    try:
        limit = number(element, "max") * UNITS.get(element.get("unit") or usual_unit, 0.0)
    except ValueError:  # such as "no limit"
        return None
    return limit if limit > 0 else None


def _limits(road: ET.Element, begin: float, end: float) -> Iterator[tuple[float, float]]:
    """Where which limit of the road's types begins within a section: m from the section's start, m/s."""
    types = sorted(road.findall("type"), key=lambda kind: number(kind, "s"))
    for kind, following in pairwise([*types, None]):
        assert kind is not None
        starts, stops = number(kind, "s"), end if following is None else number(following, "s")
        element = kind.find("speed")
        limit = None if element is None else speed(element)
        if limit is not None and starts < end and stops > begin:
            yield max(starts - begin, 0.0), limit


def _set_speeds(lane: ET.Element, of_road: list[tuple[float, float]]) -> None:
    """Gives a lane its own limits, or else those of the road, in m/s."""
    own = [(number(element, "sOffset"), speed(element)) for element in lane.findall("speed")]
    for element in lane.findall("speed"):
        lane.remove(element)
    limits = [(at, limit) for at, limit in own if limit is not None] or of_road
    for at, limit in limits:
        ET.SubElement(lane, "speed", sOffset=repr(at), max=repr(limit), unit="m/s")


def _mend_links(root: ET.Element) -> Dropped:
    """Removes links to roads that are not there."""
    dropped: Dropped = Counter()
    roads = {road.get("id") for road in root.findall("road")}
    for link in root.findall("road/link"):
        for end in list(link):
            lost = end.get("elementType") == "road" and end.get("elementId") not in roads
            if lost or not end.get("elementId") or end.get("elementType") not in ("road", "junction"):
                dropped["links to roads that are not there"] += 1
                link.remove(end)
    return dropped


def _mend_junctions(root: ET.Element) -> Dropped:
    """Removes connections of roads that are not there, and turns direct junctions into usual ones."""
    dropped: Dropped = Counter()
    roads = {road.get("id"): road for road in root.findall("road")}
    for junction in root.findall("junction"):
        if not junction.get("id"):
            dropped["junctions without a name"] += 1
            root.remove(junction)
        for connection in junction.findall("connection"):
            direct = connection.get("linkedRoad")
            joined = (connection.get("incomingRoad"), direct or connection.get("connectingRoad"))
            if not all(road in roads for road in joined):
                dropped["connections of roads that are not there"] += 1
                junction.remove(connection)
                continue
            for lane_link in connection.findall("laneLink"):
                if not (_is_integer(lane_link.get("from")) and _is_integer(lane_link.get("to"))):
                    dropped["connections of lanes without a number"] += 1
                    connection.remove(lane_link)
            connection.set("id", connection.get("id") or "0")
            connection.set("contactPoint", connection.get("contactPoint") or "start")
            if direct:
                junction.remove(connection)
                junction.extend(_direct(connection, roads[joined[0]], str(junction.get("id"))))
    return dropped


def _direct(connection: ET.Element, incoming: ET.Element, junction: str) -> Iterator[ET.Element]:
    """A connection of a direct junction (section 12.6) as usual ones, each with one lane, in the direction of traffic:
    netconvert joins two roads as well as a road and its connecting road."""
    successor = incoming.find("link/successor")
    at_end = successor is not None and successor.get("elementId") == junction
    for link in connection.findall("laneLink"):
        roads, lanes = (str(incoming.get("id")), str(connection.get("linkedRoad"))), (link.get("from"), link.get("to"))
        contact = str(connection.get("contactPoint"))
        if (number(link, "from") < 0) != at_end:  # its traffic comes from the linked road
            roads, lanes, contact = roads[::-1], lanes[::-1], "end" if at_end else "start"
        usual = ET.Element(
            "connection", id=str(connection.get("id")), incomingRoad=roads[0], connectingRoad=roads[1],
            contactPoint=contact,
        )  # fmt: skip
        ET.SubElement(usual, "laneLink", {"from": str(lanes[0]), "to": str(lanes[1])})
        yield usual
