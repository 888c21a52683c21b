"""Where people walk: closed loops in the middle of the sidewalks, and the crossings from one loop to another."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray

from caldrive.datatypes import Points
from caldrive.geometry import Polyline
from caldrive.world.roads.network import SIDEWALK_WIDTH, RoadNetwork, rings

GRAIN = 0.05  # m between two rows of a table of places
CROSSING_SPACING = 2.0  # m of kerb from one crossing to the next
SHORTEST_CROSSING, LONGEST_CROSSING = 5.0, 22.0  # m
SPACE_PER_PERSON = 3.0  # m of sidewalk
LONGEST_ISLAND = 100.0  # m around an island in the road where nobody walks
Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Crossing:
    """A way straight over the road, from a place on one loop to a place on another or the same."""

    loop: int
    """Number of the loop where it starts."""
    s: float
    """m along that loop."""
    start: Points
    """(2,), m."""
    end: Points
    """(2,), m."""
    end_loop: int
    """Number of the loop where it ends."""
    end_s: float
    """m along that loop."""

    def back(self) -> Crossing:
        """The same way in the other direction."""
        return Crossing(
            loop=self.end_loop, s=self.end_s, start=self.end, end=self.start, end_loop=self.loop, end_s=self.s
        )


class Loops(NamedTuple):
    """Places on closed lines, for compiled code."""

    lengths: Floats
    """Of the lines, m."""
    table: Floats
    """x, y, heading every `grain` metres of all lines, one after the other."""
    first: NDArray[np.int64]
    """Each line's first row in the table."""
    grain: float
    """m."""


@dataclass(frozen=True)
class Sidewalks:
    """A town's sidewalk loops."""

    crossings: tuple[tuple[Crossing, ...], ...]
    """Those that start on each loop, ordered by s."""
    loops: Loops


@lru_cache(maxsize=8)
def find_sidewalks(roads: RoadNetwork) -> Sidewalks:
    """The sidewalk loops of a town, and every other metre of kerb where one can cross."""
    middle = _without_islands(roads.roadway.buffer(SIDEWALK_WIDTH / 2))
    loops = [ring.simplify(0.02) for ring in rings(middle)]
    tables = [_table(Polyline(shapely.get_coordinates(ring))) for ring in loops]
    shapely.prepare(middle)
    tree = shapely.STRtree(loops)
    return Sidewalks(
        crossings=tuple(_crossings(loop, table, tree, middle) for loop, table in enumerate(tables)),
        loops=Loops(
            lengths=np.array([ring.length for ring in loops]),
            table=np.concatenate(tables),
            first=np.cumsum([0, *(len(table) for table in tables[:-1])]),
            grain=GRAIN,
        ),
    )


def _without_islands(area: shapely.Geometry) -> shapely.Geometry:
    """An area without its small holes: nobody walks on the island of a roundabout."""
    return shapely.MultiPolygon(
        [
            shapely.Polygon(part.exterior, [hole for hole in part.interiors if hole.length > LONGEST_ISLAND])
            for part in shapely.get_parts(area)
        ]
    )


def _table(ring: Polyline) -> Floats:
    """x, y, heading every GRAIN metres of a closed line."""
    at = np.arange(0.0, ring.length + GRAIN, GRAIN)
    middles = (ring.s[1:] + ring.s[:-1]) / 2
    return np.column_stack((ring.points_at(at), np.interp(at, middles, np.unwrap(ring.headings))))


def _crossings(loop: int, table: Floats, tree: shapely.STRtree, middle: shapely.Geometry) -> tuple[Crossing, ...]:
    """Straight over the road every CROSSING_SPACING metres of a loop: towards the inside of the road area, up to the
    next loop. tree: of all loops."""
    rows = np.arange(int(1.0 / GRAIN), len(table) - int(1.0 / GRAIN), int(CROSSING_SPACING / GRAIN))
    here, heading = table[rows, :2], table[rows, 2]
    sideways = np.stack((-np.sin(heading), np.cos(heading)), axis=1)
    inwards = np.where(shapely.contains_xy(middle, here + 0.3 * sideways)[:, None], sideways, -sideways)
    reach = np.arange(0.3, LONGEST_CROSSING, 0.5)
    beams = here[:, None] + reach[:, None] * inwards[:, None]
    inside = shapely.contains_xy(middle, beams.reshape(-1, 2)).reshape(beams.shape[:2])
    last = np.argmin(inside, axis=1) - 1  # the first place beyond the far loop, and one back
    usable = ~inside.all(1) & (reach[last] > SHORTEST_CROSSING)
    ends = shapely.points(beams[np.arange(len(last)), last][usable])
    end_loops = tree.nearest(ends)
    loops = tree.geometries
    end_s = [loops[k].project(end) for k, end in zip(end_loops, ends, strict=True)]
    places = [loops[k].interpolate(s).coords[0] for k, s in zip(end_loops, end_s, strict=True)]
    return tuple(
        Crossing(loop=loop, s=float(row * GRAIN), start=start, end=end, end_loop=int(k), end_s=float(s))
        for row, start, end, k, s in zip(
            rows[usable], here[usable], np.array(places).reshape(-1, 2), end_loops, end_s, strict=True
        )
    )


def room(roads: RoadNetwork) -> int:
    """How many people a town's sidewalks hold."""
    return int(find_sidewalks(roads).loops.lengths.sum() / SPACE_PER_PERSON)


def require_room(roads: RoadNetwork, n: int) -> None:
    """Raises ValueError for more people than there is room for."""
    if n > room(roads):
        raise ValueError(
            f"found {n} people asked for, but {roads.name} has room for {room(roads)}: ask for fewer with --people"
        )
