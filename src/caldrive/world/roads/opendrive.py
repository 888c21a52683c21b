"""What SUMO does not take from an OpenDRIVE map: where its speed signs and its traffic lights stand."""

from __future__ import annotations

import math
import re
from xml.etree import ElementTree as ET

import numpy as np

from caldrive.datatypes import SPEED_SIGNS, Pose, Sign
from caldrive.geometry import moved, wrap_angle
from caldrive.world.roads.safe_xml import parse_xml

_LIGHT_TYPE = "1000001"  # OpenDRIVE's own number for a three-lamp light
LONGEST_ROAD = 1e5  # m
_SPEED_TYPE = "274"  # the German catalogue's number for a limit, which OpenDRIVE files use


def _number(element: ET.Element, name: str) -> float:
    number = float(element.get(name) or 0.0)
    if not math.isfinite(number):
        raise ValueError(f"<{element.tag}> has {name}={number}")
    return number


def _along(geometry: ET.Element, ds: float) -> Pose:
    """The reference line's pose ds metres into a geometry: line, arc, spiral or paramPoly3."""
    start = Pose(_number(geometry, "x"), _number(geometry, "y"), _number(geometry, "hdg"))
    shape = next(iter(geometry), None)
    if shape is None:
        raise ValueError("a <geometry> is no line, arc, spiral or polynomial")
    if shape.tag == "paramPoly3":
        return _along_polynomial(start, shape, ds, _number(geometry, "length"))
    first = last = 0.0
    if shape.tag == "arc":
        first = last = _number(shape, "curvature")
    elif shape.tag == "spiral":
        first = _number(shape, "curvStart")
        share = ds / max(_number(geometry, "length"), 1e-9)
        last = first + share * (_number(shape, "curvEnd") - first)
    s = np.linspace(0, ds, 65)
    heading = start.heading + first * s + (last - first) * s**2 / (2 * max(ds, 1e-9))
    x, y = np.trapezoid(np.cos(heading), s), np.trapezoid(np.sin(heading), s)
    return Pose(start.x + float(x), start.y + float(y), wrap_angle(float(heading[-1])))


def _along_polynomial(start: Pose, shape: ET.Element, ds: float, length: float) -> Pose:
    p = ds if shape.get("pRange") == "arcLength" else ds / length
    u, v = ([_number(shape, f"{k}{axis}") for k in "dcba"] for axis in "UV")
    turn = math.atan2(float(np.polyval(np.polyder(v), p)), float(np.polyval(np.polyder(u), p)))
    return moved(start, float(np.polyval(u, p)), float(np.polyval(v, p)), turn)


def _pose(road: ET.Element, thing: ET.Element, heading_name: str) -> Pose:
    """Of a sign or signal; heading: that of the traffic it faces, which drives on the right."""
    s, t = _number(thing, "s"), _number(thing, "t")
    here = [g for g in road.findall("planView/geometry") if _number(g, "s") <= s + 1e-6]
    if not here:
        raise ValueError(f"road {road.get('id')} has no <geometry> at s={s}, where <{thing.tag}> {thing.get('id')} is")
    offset = 0.0 if t < 0 else math.pi
    if thing.get(heading_name):
        # CARLA counts it from the road, the standard from the thing's orientation: they differ by half a turn.
        offset += math.remainder(_number(thing, heading_name) - offset, math.pi)
    return moved(_along(here[-1], s - _number(here[-1], "s")), left=t, turn=offset)


def _limit(thing: ET.Element) -> int | None:
    """The limit on a sign, from a name such as Speed_30 or from type 274 and its value, if it is one of ours."""
    named = re.search(r"[Ss]peed[^0-9]*(\d+)", thing.get("name") or "")
    value = float(named.group(1)) if named else _number(thing, "value") if thing.get("type") == _SPEED_TYPE else 0.0
    return int(value) if value in SPEED_SIGNS else None


def read_furniture(content: bytes) -> tuple[list[Pose], list[Sign]]:
    """Posts of traffic lights and speed signs of an OpenDRIVE map, each once. Raises ValueError with the reason where
    it is none."""
    root = parse_xml(content)
    if root.tag != "OpenDRIVE":
        raise ValueError(f"it is <{root.tag}>, not <OpenDRIVE>")
    return _furniture(root)


def _require_lengths(road: ET.Element) -> None:
    """Raises ValueError for a length that no road has: netconvert would work on it for hours."""
    for part in (road, *road.findall("planView/geometry")):
        if not 0 <= _number(part, "length") <= LONGEST_ROAD:
            raise ValueError(f"<{part.tag}> of road {road.get('id')} has length={part.get('length')}")


def _furniture(root: ET.Element) -> tuple[list[Pose], list[Sign]]:
    posts, signs = [], {}
    for road in root.findall("road"):
        _require_lengths(road)
        for thing in [*road.findall("signals/signal"), *road.findall("objects/object")]:
            limit = _limit(thing)
            if limit is not None:
                pose = _pose(road, thing, "hOffset" if thing.tag == "signal" else "hdg")
                signs[(round(pose.x), round(pose.y), limit)] = Sign(pose, limit)
            elif thing.tag == "signal" and thing.get("type") == _LIGHT_TYPE:
                posts.append(_pose(road, thing, "hOffset"))
    return posts, list(signs.values())
