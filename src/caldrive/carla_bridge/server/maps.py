"""The maps that a server has: their OpenDRIVE, and where on them vehicles may be spawned."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from caldrive.carla_bridge.axes import Placement, standing
from caldrive.carla_bridge.server.wire import Refusal
from caldrive.datatypes import Pose
from caldrive.scenarios import TOWNS
from caldrive.world.roads.network import RoadNetwork
from caldrive.world.roads.opendrive import flat, read_map
from caldrive.world.roads.opendrive_roads import opendrive_roads
from caldrive.world.roads.opendrive_signals import MapSign, edge_of
from caldrive.world.roads.opendrive_writer import write_opendrive
from caldrive.world.roads.written_signals import signals_of
from caldrive.world.traffic.start_places import start_places

SPAWN_HEIGHT = 0.3  # m above the ground, as in CARLA
PREFIX = "Carla/Maps/"


@dataclass(frozen=True)
class Maps:
    """Maps by their names: the embedded towns, and a folder of OpenDRIVE files such as CARLA's."""

    folder: Path | None = None

    def __post_init__(self) -> None:
        """Raises OSError where there is no such folder."""
        if self.folder is not None and not self.folder.is_dir():
            raise FileNotFoundError(
                f"found no folder {self.folder}, wanted one with OpenDRIVE files: give another --maps"
            )

    def names(self) -> list[str]:
        """All that can be loaded by name."""
        files = sorted(path.stem for path in self.folder.glob("*.xodr")) if self.folder else []
        return [*files, *TOWNS]

    def town(self, name: str) -> str:
        """The town for a name as clients give it. Raises Refusal for an unknown one."""
        last = name.rsplit("/", 1)[-1]
        for wanted in (last, last.removesuffix("_Opt")):
            if self.folder and wanted and (self.folder / f"{wanted}.xodr").is_file():
                return str(self.folder / f"{wanted}.xodr")
            if wanted in TOWNS or wanted.startswith("random:"):
                return wanted
        raise Refusal(
            f"found no map {last!r}, wanted one of {', '.join(self.names())}: start the server with --maps FOLDER, "
            f"where {last}.xodr lies"
        )


@lru_cache(maxsize=2)
def opendrive(town: str, roads: RoadNetwork) -> str:
    """The OpenDRIVE of a town: its own file, as flat as the world is, or one that is written. Raises Refusal where none
    can be."""
    if town.endswith(".xodr"):
        return flat(Path(town).read_bytes()).decode()
    try:
        return write_opendrive(roads).decode()
    except ValueError as error:
        raise Refusal(str(error)) from error


def map_name(roads: RoadNetwork) -> str:
    """What CARLA would call it."""
    return f"{PREFIX}{roads.name}"


def spawn_points(roads: RoadNetwork) -> list[Placement]:
    """Where vehicles may be spawned, in an order that is always the same."""
    return [standing(lane.line.pose_at(s), SPAWN_HEIGHT) for lane, s in start_places(roads)]


@dataclass(frozen=True)
class SignalIds:
    """The ids that a town's signals have on its map."""

    lights: dict[str, str]
    """By the ids of their posts."""
    signs: dict[tuple[Pose, int], str]
    """By where they stand, and their limits in km/h."""


@lru_cache(maxsize=2)
def signal_ids(town: str, roads: RoadNetwork) -> SignalIds:
    """Those of a town's own file, or of the map that is written of it."""
    if not town.endswith(".xodr"):
        signals = signals_of(roads, opendrive_roads(roads))
        lights = {post.id: signal.id for signal in signals for post in signal.posts}
        return SignalIds(lights, {(one.foot, one.limit): one.id for one in signals if one.limit is not None})
    found = read_map(Path(town).read_bytes()).signals
    edges = {edge_of(approach): id for approach, id in found.ids.items()}
    lights = {post.id: edges.get(roads.lanes[post.lane].edge.partition("#")[0], "") for post in roads.posts}
    signs = {(sign.stands_at, sign.limit): _nearest(sign.stands_at, sign.limit, found.signs) for sign in roads.signs}
    return SignalIds(lights, signs)


def _nearest(foot: Pose, limit: int, signs: Iterable[MapSign]) -> str:
    """The id of the map's sign that stands nearest to one of the town's, which may have been moved beside its lane."""
    same = [sign for sign in signs if sign.limit == limit]
    return min(same, key=lambda sign: math.hypot(foot.x - sign.foot.x, foot.y - sign.foot.y)).id if same else ""
