"""An OpenDRIVE map: what netconvert gets of it, and what SUMO does not take, its signs and lights."""

from __future__ import annotations

from dataclasses import dataclass
from xml.etree import ElementTree as ET

import numpy as np

from caldrive.world.roads.opendrive_repairs import Dropped, mend, strip_unused
from caldrive.world.roads.opendrive_signals import Signals, read_signals
from caldrive.world.roads.reference_line import number
from caldrive.world.roads.safe_xml import parse_xml

FAR, GRID = 5000.0, 1000.0  # m from the origin where a map is moved, and the steps in which it is


@dataclass(frozen=True)
class OpenDriveMap:
    """A map that was read and mended."""

    roads: bytes
    """The map for netconvert: roads and junctions alone."""
    signals: Signals
    offset: tuple[float, float]
    """m, subtracted from all places of the file, so that the roads lie around the origin."""
    dropped: Dropped
    """How many of what was left out or changed."""


def read_map(content: bytes) -> OpenDriveMap:
    """Reads a map. Raises ValueError with the reason where it is none, or one that cannot be driven on."""
    root = parse_xml(content)
    dropped = mend(root)
    offset = _move_to_origin(root)
    signals = read_signals(root)
    strip_unused(root)
    return OpenDriveMap(ET.tostring(root), signals, offset, dropped + signals.dropped)


def flat(content: bytes) -> bytes:
    """A map without its hills. Raises ValueError with the reason where it is none."""
    root = parse_xml(content)
    for road in root.findall("road"):
        for profile in [*road.findall("elevationProfile"), *road.findall("lateralProfile")]:
            road.remove(profile)
    return ET.tostring(root)


def _move_to_origin(root: ET.Element) -> tuple[float, float]:
    """Moves a map that lies far away: pictures are reckoned in numbers of seven digits. Returns by how much (m)."""
    pieces = root.findall("road/planView/geometry")
    places = np.array([(number(piece, "x"), number(piece, "y")) for piece in pieces]).reshape(-1, 2)
    ahead = np.array([(number(piece, "hdg"), number(piece, "length")) for piece in pieces]).reshape(-1, 2)
    ends = places + ahead[:, 1:] * np.stack((np.cos(ahead[:, 0]), np.sin(ahead[:, 0])), axis=1)  # if it is straight
    all_places = np.concatenate((places, ends))
    middle = (all_places.min(0) + all_places.max(0)) / 2 if len(places) else np.zeros(2)
    if np.abs(middle).max() < FAR:
        return 0.0, 0.0
    offset = np.round(middle / GRID) * GRID
    for piece, place in zip(pieces, places - offset, strict=True):
        piece.set("x", repr(float(place[0])))
        piece.set("y", repr(float(place[1])))
    return float(offset[0]), float(offset[1])
