"""The lights and speed signs of a town as signals of an OpenDRIVE map: where each stands, and for which lanes it is."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import count
from xml.etree import ElementTree as ET

from caldrive.datatypes import Pose
from caldrive.world.roads.network import LightPost, RoadNetwork
from caldrive.world.roads.opendrive_roads import OpenDriveNetwork

# Three lamps by OpenDRIVE's own numbers, a speed sign by Germany's; the names are those of CARLA's maps.
_LIGHT = {
    "name": "Signal_3Light_Post01", "dynamic": "yes", "country": "OpenDRIVE", "type": "1000001", "subtype": "-1",
    "value": "-1",
}  # fmt: skip
_SIGN = {"dynamic": "no", "country": "DE", "countryRevision": "2017", "type": "274", "unit": "km/h"}


@dataclass(frozen=True)
class Signal:
    """A light or a speed sign."""

    id: str
    road: int
    """The street that it stands on."""
    s: float
    """m along the reference line."""
    t: float
    """m to its left."""
    lanes: tuple[int, int]
    """The first and the last lane that it is for."""
    posts: tuple[LightPost, ...] = ()
    """The town's lights that it is, one for each lane; none for a sign."""
    limit: int | None = None
    """km/h on a sign, None for a light."""


def signals_of(roads: RoadNetwork, network: OpenDriveNetwork) -> tuple[Signal, ...]:
    """The signals of a town, one for each post. Their numbers follow those of the roads."""
    ids = map(str, count(network.next_id))
    posts = defaultdict[tuple[str, Pose], list[LightPost]](list)
    for post in roads.posts:
        posts[post.approach[1], post.stands_at].append(post)
    lights = [_light(next(ids), network, tuple(shared)) for shared in posts.values()]
    signs = dict.fromkeys((sign.stands_at, sign.limit) for sign in roads.signs)
    return (*lights, *(_sign(next(ids), roads, network, foot, limit) for foot, limit in signs))


def _light(id: str, network: OpenDriveNetwork, posts: tuple[LightPost, ...]) -> Signal:
    """A light, which stands at its stop line: at one end of its street."""
    places = [network.places[post.lane] for post in posts]
    street, foot = network.streets[places[0][0]], posts[0].stands_at
    _, t = street.locate(foot.x, foot.y)
    lanes = sorted(lane for _, lane in places)
    return Signal(id, street.id, street.length if lanes[0] < 0 else 0.0, t, (lanes[0], lanes[-1]), posts)


def _sign(id: str, roads: RoadNetwork, network: OpenDriveNetwork, foot: Pose, limit: int) -> Signal:
    """A speed sign, for all lanes of its direction."""
    street_id, lane = network.places[roads.lane_at(foot)[0].id]
    street = network.streets[street_id]
    lanes = (-len(street.right.widths), -1) if lane < 0 else (1, len(street.left.widths))
    return Signal(id, street_id, *street.locate(foot.x, foot.y), lanes, limit=limit)


def add_signals(road: ET.Element, signals: Iterable[Signal]) -> None:
    """Adds the signals of a road to it."""
    parent = ET.SubElement(road, "signals")
    for signal in signals:
        along, limit = signal.lanes[0] < 0, str(signal.limit)
        kind = (
            {**_LIGHT}
            if signal.limit is None
            else {**_SIGN, "name": f"Speed_{limit}", "subtype": limit, "value": limit}
        )
        element = ET.SubElement(
            parent, "signal", kind, id=signal.id, s=f"{signal.s:.6f}", t=f"{signal.t:.6f}", zOffset="0",
            orientation="+" if along else "-", hOffset="0" if along else f"{math.pi:.6f}",
        )  # fmt: skip
        ET.SubElement(element, "validity", fromLane=str(signal.lanes[0]), toLane=str(signal.lanes[1]))


def add_controllers(root: ET.Element, network: OpenDriveNetwork, signals: Iterable[Signal]) -> dict[int, list[str]]:
    """Adds a controller for the lights of each approach, which are green together; their ids by their junctions."""
    groups = defaultdict[tuple[str, str], list[Signal]](list)
    for signal in signals:
        if signal.posts:
            groups[signal.posts[0].approach].append(signal)
    by_junction = defaultdict[int, list[str]](list)
    for id, (approach, members) in enumerate(groups.items()):
        controller = ET.SubElement(root, "controller", id=str(id), name="/".join(approach), sequence="0")
        for signal in members:
            ET.SubElement(controller, "control", signalId=signal.id, type="0")
        junction = network.streets[members[0].road].ends[members[0].lanes[0] < 0]
        if isinstance(junction, int):
            by_junction[junction].append(str(id))
    return by_junction
