"""The speed signs and traffic lights of an OpenDRIVE map, and for which traffic they are.

What a signal is for is told by the lanes and the orientation that it names, never by the way its post is turned: maps
differ in what `hOffset` counts from.
"""

from __future__ import annotations

import math
import re
from collections import Counter, defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, field
from xml.etree import ElementTree as ET

from caldrive.datatypes import KMH, SPEED_SIGNS, Pose
from caldrive.geometry import moved, wrap_angle
from caldrive.world.roads.opendrive_repairs import UNITS, Dropped
from caldrive.world.roads.reference_line import number, pose_on_line

LIGHTS = frozenset({1000001, 1000009, 1000010, 1000011, 1000012, 1000020})  # for cars; OpenDRIVE's own numbers
ZONE_LIMIT = 30.0  # km/h of a German zone (274.1) that names none
OF_2013 = {str(51 + k): 10.0 * (k + 1) for k in range(13)}  # km/h by the subtype of sign 274 before 2017
NEAR_JUNCTION = 50.0  # m from a junction within which a light is one of its lights
BEYOND = 0.5  # m past the end of a road where a sign still stands on it
Approach = tuple[str, bool]  # a road, and whether its traffic along the reference line is meant, or that against it


def edge_of(approach: Approach) -> str:
    """What netconvert calls the lanes of a road in one direction; it marks those along the reference line."""
    road, forward = approach
    return f"-{road}" if forward else road


@dataclass(frozen=True)
class MapSign:
    """A speed sign of a map."""

    approach: Approach
    """The road and the direction that it counts for."""
    at: Pose
    """The place on the road's reference line beside it, with the heading of its traffic."""
    foot: Pose
    """Where it stands."""
    limit: int
    """km/h, one of SPEED_SIGNS."""
    id: str = ""
    """The map's own."""


@dataclass(frozen=True)
class Signals:
    """What of a map's signals is used."""

    signs: tuple[MapSign, ...]
    lights: dict[Approach, tuple[Pose, ...]]
    """Where the lights of each approach to a junction stand."""
    junctions: frozenset[str]
    """Ids of those with lights."""
    dropped: Dropped
    ids: dict[Approach, str] = field(default_factory=dict)
    """The map's own id of the first light of each approach."""


def read_signals(root: ET.Element) -> Signals:
    """Signs and lights of a mended map, each once. Raises ValueError for a number that is none."""
    reader = _Reader(root)
    for road in root.findall("road"):
        for thing in [*road.findall("signals/signal"), *road.findall("objects/object")]:
            reader.read(road, thing)
    lights = {approach: tuple(feet) for approach, feet in reader.lights.items()}
    junctions = frozenset(str(reader.junction_of(approach)) for approach in lights)
    return Signals(tuple(reader.signs.values()), lights, junctions, reader.dropped, reader.ids)


def limit_on(thing: ET.Element) -> float | None:
    """The limit on a sign in km/h: by a name such as Speed_30 (CARLA), as sign 274 (Germany), R2-1 (USA) or maxSpeed
    (OpenDRIVE). NaN on a speed sign that names none, None where it is no speed sign."""
    named = re.search(r"[Ss]peed[^0-9]*(\d+)", thing.get("name") or "")
    if named:
        return float(named.group(1)) * _unit(thing, "km/h")
    kind, _, more = (thing.get("type") or "").partition("-")
    value, subtype = max(number(thing, "value"), 0.0), more or thing.get("subtype") or ""
    if (thing.get("type") or "").upper().startswith("R2-1"):
        return value * _unit(thing, "mph") or math.nan
    if kind.lower() == "maxspeed" and value:
        return value * _unit(thing, "km/h")
    if kind in ("274", "274.1"):
        return value * _unit(thing, "km/h") or _german(thing, kind, subtype)
    return None


def _unit(thing: ET.Element, usual: str) -> float:
    """km/h in the unit of a sign's value."""
    return UNITS.get(thing.get("unit") or usual, UNITS[usual]) / KMH


def _german(thing: ET.Element, kind: str, subtype: str) -> float:
    """The limit by the subtype: since 2017 the number on the sign, before that a number of the catalogue."""
    if kind == "274.1":
        return float(subtype) if subtype.isdigit() else ZONE_LIMIT
    revision = (thing.get("countryRevision") or "")[:4]
    is_old = revision.isdigit() and int(revision) < 2017
    if subtype in OF_2013 and (is_old or int(subtype) % 10):
        return OF_2013[subtype]
    return float(subtype) if subtype.isdigit() else math.nan


def shown_limit(limit: float) -> int | None:
    """The highest limit that a sign of ours shows and that keeps to a limit in km/h, None where there is none."""
    return max((shown for shown in SPEED_SIGNS if shown <= limit + 0.5), default=None)


class _Reader:
    """Goes through a map's signals and objects."""

    def __init__(self, root: ET.Element) -> None:
        self.roads = {str(road.get("id")): road for road in root.findall("road")}
        # RoadRunner, with which CARLA's maps are made, has always written the orientation the other way round.
        self.turned = root.find("header/userData/vectorScene") is not None
        self.dropped: Dropped = Counter()
        self.signs: dict[tuple[int, int, int], MapSign] = {}
        self.lights: defaultdict[Approach, list[Pose]] = defaultdict(list)
        self.ids: dict[Approach, str] = {}
        self.references: defaultdict[str, list[Approach]] = defaultdict(list)
        for road in self.roads.values():
            for reference in road.findall("signals/signalReference"):
                self.references[reference.get("id") or ""] += self._approaches(road, reference)

    def read(self, road: ET.Element, thing: ET.Element) -> None:
        """Notes a sign or a light, or that something is left out."""
        limit, is_signal = limit_on(thing), thing.tag == "signal"
        if limit is None and is_signal and not thing.get("type"):
            self.dropped["signals without a type"] += 1
        elif limit is not None or (is_signal and _is_light(thing)):
            if not -BEYOND <= number(thing, "s") <= number(road, "length") + BEYOND:
                self.dropped["signals beyond the end of their road"] += 1
            elif limit is None:
                self._read_light(road, thing)
            else:
                self._read_sign(road, thing, limit)

    def _read_sign(self, road: ET.Element, thing: ET.Element, limit: float) -> None:
        shown = shown_limit(limit)
        if shown is None:
            self.dropped[f"speed signs without a limit of {SPEED_SIGNS[0]} km/h or more"] += 1
            return
        approach, at, foot = self._place(road, thing)
        self.signs[round(foot.x), round(foot.y), shown] = MapSign(approach, at, foot, shown, thing.get("id") or "")

    def _read_light(self, road: ET.Element, thing: ET.Element) -> None:
        approaches = self.references.get(thing.get("id") or "") or self._approaches(road, thing)
        if not approaches:
            self.dropped["traffic lights at no junction"] += 1
        _, _, foot = self._place(road, thing)
        for approach in dict.fromkeys(approaches):
            self.lights[approach].append(foot)
            self.ids.setdefault(approach, thing.get("id") or "")

    def _place(self, road: ET.Element, thing: ET.Element) -> tuple[Approach, Pose, Pose]:
        """For whom something is, where that is on the reference line, and where it stands."""
        forward, line = self._is_forward(thing), pose_on_line(road, number(thing, "s"))
        turn = 0.0 if forward else math.pi
        foot = moved(line, left=number(thing, "t"), turn=turn)
        return (str(road.get("id")), forward), moved(line, turn=turn), foot

    def _is_forward(self, thing: ET.Element) -> bool:
        """Whether something is for the traffic along its road's reference line."""
        lanes = [number(v, name) for v in thing.findall("validity") for name in ("fromLane", "toLane")]
        if lanes and (min(lanes) > 0 or max(lanes) < 0):
            return max(lanes) < 0
        orientation = thing.get("orientation")
        if orientation in ("+", "-"):
            return (orientation == "+") != self.turned
        return number(thing, "t") <= 0  # on the right of its traffic

    def _approaches(self, road: ET.Element, thing: ET.Element) -> list[Approach]:
        """The ways into a junction that a light is for, or that it stands behind."""
        name, forward, s = str(road.get("id")), self._is_forward(thing), number(thing, "s")
        if road.get("junction") != "-1":
            return list(self._incoming(road, forward))
        to_end = number(road, "length") - s if forward else s
        ahead = self.junction_of((name, forward)) if to_end < NEAR_JUNCTION else None
        behind = self.junction_of((name, not forward)) if number(road, "length") - to_end < NEAR_JUNCTION else None
        if ahead is not None and (behind is None or to_end <= number(road, "length") / 2):
            return [(name, forward)]
        return self._across(name, forward, behind) if behind is not None else []

    def _incoming(self, connecting: ET.Element, forward: bool) -> Iterator[Approach]:
        """The way that leads into a connecting road."""
        link = connecting.find("link/predecessor" if forward else "link/successor")
        if link is not None and link.get("elementType") == "road":
            yield str(link.get("elementId")), link.get("contactPoint") == "end"

    def _across(self, name: str, forward: bool, junction: str) -> list[Approach]:
        """The way into a junction from which the straightest connecting road leads to where a road leaves it."""
        ways = []
        for road in self.roads.values():
            if road.get("junction") != junction:
                continue
            length = number(road, "length")
            bend = abs(wrap_angle(pose_on_line(road, length).heading - pose_on_line(road, 0.0).heading))
            for along in (True, False):
                if (name, not forward) in self._incoming(road, not along):
                    ways += [(bend, approach) for approach in self._incoming(road, along)]
        return [min(ways)[1]] if ways else []

    def junction_of(self, approach: Approach) -> str | None:
        """The junction that a way leads into."""
        road = self.roads.get(approach[0])
        link = None if road is None else road.find("link/successor" if approach[1] else "link/predecessor")
        return link.get("elementId") if link is not None and link.get("elementType") == "junction" else None


def _is_light(thing: ET.Element) -> bool:
    number, _, _ = (thing.get("type") or "").partition(".")
    return number.isdigit() and int(number) in LIGHTS
