"""The maps that a server has: their OpenDRIVE, and where on them vehicles may be spawned."""

from __future__ import annotations

from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

from caldrive.carla_bridge.axes import Placement, standing
from caldrive.carla_bridge.server.wire import Refusal
from caldrive.scenarios import TOWNS
from caldrive.world.roads.network import RoadNetwork
from caldrive.world.traffic.start_places import start_places

SPAWN_HEIGHT = 0.3  # m above the ground, as in CARLA
PREFIX = "Carla/Maps/"
CROSSING = 8.0  # m of a street at least that a spawn point is on


@dataclass(frozen=True)
class Maps:
    """Maps by their names: the embedded towns, and a folder of OpenDRIVE files such as CARLA's."""

    folder: Path | None = None

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


def opendrive(town: str, roads: RoadNetwork) -> str:
    """The OpenDRIVE of a town. Raises Refusal where there is none."""
    if town.endswith(".xodr"):
        return Path(town).read_text()
    if find_spec("caldrive.world.roads.opendrive_writer") is not None:
        from importlib import import_module

        written: str = import_module("caldrive.world.roads.opendrive_writer").opendrive(roads)
        return written
    raise Refusal(f"found no OpenDRIVE of {town}, wanted a map file: start the server with --town FILE.xodr")


def map_name(roads: RoadNetwork) -> str:
    """What CARLA would call it."""
    return f"{PREFIX}{roads.name}"


def spawn_points(roads: RoadNetwork) -> list[Placement]:
    """Where vehicles may be spawned, in an order that is always the same."""
    return [standing(lane.line.pose_at(s), SPAWN_HEIGHT) for lane, s in start_places(roads)]


def signal_ids(town: str, roads: RoadNetwork) -> dict[str, str]:
    """The ids that a town's lights have on its map, by those of their posts."""
    return {}
