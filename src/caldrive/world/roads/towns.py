"""Towns by name, by seed or by OpenDRIVE file."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace
from functools import lru_cache
from multiprocessing import parent_process
from pathlib import Path

from caldrive.scenarios import TOWNS, generated_town
from caldrive.world.roads.generated import load_generated
from caldrive.world.roads.map_cache import digest, kept_network
from caldrive.world.roads.network import RoadNetwork
from caldrive.world.roads.sumo_reader import read_roads

MOST_MEGABYTES = 64  # of a map's file; cities of hundreds of kilometres of road have less

_DATA = Path(__file__).parent / "data"


@lru_cache(maxsize=4)
def load_roads(town: str) -> RoadNetwork:
    """The roads of `town01`, `town02`, a generated town such as `random:7`, or an OpenDRIVE file. Raises ValueError,
    OSError, or RuntimeError where a town needs what is not installed."""
    if town in TOWNS:
        return read_roads(town, _DATA / f"{town}.net.xml", appearance=town)
    if generated := generated_town(town):
        return load_generated(generated)
    path = Path(town)
    if path.suffix != ".xodr":
        raise ValueError(
            f"found town {town!r}, wanted one of {', '.join(TOWNS)}, random:SEED or an OpenDRIVE file: "
            "type --town town01, --town random:7 or --town FILE.xodr"
        )
    if not path.is_file():
        raise FileNotFoundError(f"found no file {town}, wanted an OpenDRIVE map: check the path given to --town")
    return _load_opendrive(path)


def _load_opendrive(path: Path) -> RoadNetwork:
    from caldrive.world.roads.map_furniture import furnish
    from caldrive.world.roads.netconvert import conversion, convert_opendrive, netconvert_binary
    from caldrive.world.roads.opendrive import read_map

    netconvert_binary()  # else every map would seem broken
    content = _content(path)
    with one_sentence(str(path)):
        on_map = read_map(content)
        junctions = sorted(on_map.signals.junctions)
        network = kept_network(
            digest(on_map.roads, repr(junctions).encode(), conversion()),
            lambda: convert_opendrive(on_map.roads, junctions),
        )
        roads, dropped = furnish(read_roads(path.stem, network, appearance="town01"), on_map.signals)
    lost = tuple(f"{what} ({n})" for what, n in sorted((on_map.dropped + dropped).items()))
    _say_once(path, lost)
    return replace(roads, offset=on_map.offset, dropped=lost)


def _say_once(path: Path, lost: tuple[str, ...]) -> None:
    """Tells the user what was left out of a map; one of several processes does."""
    if lost and parent_process() is None:
        with suppress(OSError, ValueError):  # nobody may listen any more
            print(f"caldrive: left out or changed in {path.name}: {', '.join(lost)}", file=sys.stderr)


def _content(path: Path) -> bytes:
    """The bytes of a map. Raises ValueError for a file that is too large to be one, OSError where it is unreadable."""
    with path.open("rb") as file:
        content = file.read(MOST_MEGABYTES * 10**6 + 1)
    if len(content) > MOST_MEGABYTES * 10**6:
        raise ValueError(
            f"found more than {MOST_MEGABYTES} MB in {path}, wanted an OpenDRIVE map of {MOST_MEGABYTES} MB at most: "
            "cut a smaller part out of it"
        )
    return content


@contextmanager
def one_sentence(town: str) -> Iterator[None]:
    """Says of whatever goes wrong over somebody's map which file is to blame; what goes wrong over our own towns is a
    fault of the program. Raises ValueError."""
    try:
        yield
    except Exception as error:  # no list of what XML, SUMO, numpy and shapely may raise would be complete
        if town in TOWNS or generated_town(town):
            raise
        kind = "" if type(error) is ValueError else f"{type(error).__name__}: "
        raise ValueError(
            f"found that {town} cannot be read ({kind}{error}), wanted an OpenDRIVE map: give another .xodr file"
        ) from error
