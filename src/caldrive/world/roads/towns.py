"""Towns by name or by OpenDRIVE file."""

from __future__ import annotations

import os
import tempfile
from functools import lru_cache
from pathlib import Path

from caldrive.provenance import file_digest
from caldrive.world.roads.network import RoadNetwork
from caldrive.world.roads.sumo_reader import read_roads

TOWNS = ("town01", "town02")

_DATA = Path(__file__).parent / "data"


def _cache_folder() -> Path:
    """Where converted maps are kept between runs."""
    base = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    folder = Path(base) / "caldrive"
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError:
        folder = Path(tempfile.mkdtemp(prefix="caldrive-"))
    return folder


@lru_cache(maxsize=4)
def load_roads(town: str) -> RoadNetwork:
    """The roads of `town01`, `town02` or an OpenDRIVE file. Raises ValueError or FileNotFoundError."""
    if town in TOWNS:
        return read_roads(town, _DATA / f"{town}.net.xml", appearance=town)
    path = Path(town)
    if path.suffix != ".xodr":
        raise ValueError(
            f"found town {town!r}, wanted one of {', '.join(TOWNS)} or an OpenDRIVE file: "
            "type --town town01 or --town FILE.xodr"
        )
    if not path.is_file():
        raise FileNotFoundError(f"found no file {town}, wanted an OpenDRIVE map: check the path given to --town")
    return _load_opendrive(path)


def _load_opendrive(path: Path) -> RoadNetwork:
    from caldrive.world.roads.netconvert import convert_opendrive
    from caldrive.world.roads.opendrive import read_furniture

    posts, signs = read_furniture(path)
    network = _cache_folder() / f"{path.stem}-{file_digest(path)}.net.xml"
    if not network.is_file():
        convert_opendrive(path, network)
    return read_roads(path.stem, network, appearance="town01", posts=posts, signs=signs)
