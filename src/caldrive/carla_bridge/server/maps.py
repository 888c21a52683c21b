"""The maps that a server has: their OpenDRIVE, and where on them vehicles may be spawned."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from caldrive.carla_bridge.axes import Placement, standing
from caldrive.carla_bridge.server.wire import Refusal
from caldrive.scenarios import TOWNS
from caldrive.world.roads.network import RoadNetwork
from caldrive.world.roads.opendrive import read_map
from caldrive.world.roads.opendrive_roads import opendrive_roads
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
    """The OpenDRIVE of a town: its own file, or one that is written. Raises Refusal where none can be."""
    if town.endswith(".xodr"):
        return Path(town).read_text()
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


@lru_cache(maxsize=2)
def signal_ids(town: str, roads: RoadNetwork) -> dict[str, str]:
    """The ids that a town's lights have on its map, by those of their posts."""
    if town.endswith(".xodr"):
        ids = read_map(Path(town).read_bytes()).signals.ids
        # netconvert marks the lanes along the reference line of a road
        edges = {f"-{road}" if forward else road: id for (road, forward), id in ids.items()}
        found = {post.id: edges.get(roads.lanes[post.lane].edge.partition("#")[0]) for post in roads.posts}
        return {post: id for post, id in found.items() if id}
    signals = signals_of(roads, opendrive_roads(roads))
    return {post.id: str(signal.id) for signal in signals for post in signal.posts}
