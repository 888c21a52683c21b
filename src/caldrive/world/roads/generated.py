"""Generated towns: everything from a seed. A town that fails its checks is drawn again from the next sub-seed."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from caldrive.scenarios import GeneratedTown
from caldrive.world.roads.generated_config import CONFIGS
from caldrive.world.roads.generated_plan import draw_plan
from caldrive.world.roads.map_cache import digest, kept_network
from caldrive.world.roads.network import RoadNetwork
from caldrive.world.roads.packed_networks import ARCHIVE, packed_names, packed_network, stripped
from caldrive.world.roads.plan_network import network_of, plain_network
from caldrive.world.roads.plans import Plan
from caldrive.world.roads.sumo_reader import read_roads

SALT = 20181031  # parts these random numbers from those of other things with the same seed
MOST_TRIES = 200  # sub-seeds of a town
OPTIONS = ("--precision=2", "--junctions.internal-link-detail=8", "--junctions.corner-detail=3")  # enough, and small


def load_generated(town: GeneratedTown) -> RoadNetwork:
    """The roads of a generated town: those of the package's suites are in it, others are drawn.

    Raises RuntimeError where that needs netconvert and it is not installed.
    """
    if town.name in packed_names():
        network = kept_network(digest(ARCHIVE.read_bytes(), town.name.encode()), lambda: packed_network(town.name))
        return read_roads(town.name, network, appearance=town.name)
    return draw_town(town)


def draw_town(town: GeneratedTown) -> RoadNetwork:
    """The first of a town's sub-seeds that passes all checks. Raises RuntimeError where netconvert is not installed."""
    from caldrive.world.roads.road_checks import faults

    for sub_seed in range(MOST_TRIES):
        rng = np.random.default_rng([SALT, town.seed, sub_seed])
        plan = draw_plan(town.name, CONFIGS[town.kind], rng)
        if plan is not None:
            roads = read_roads(town.name, _network(plan), appearance=town.name)
            if next(faults(roads), None) is None:
                return roads
    raise ValueError(f"found no sound town in {MOST_TRIES} tries for {town.name}, wanted one: type another seed")


def _network(plan: Plan) -> Path:
    """The file of a plan's network, made once."""
    from caldrive.world.roads.netconvert import conversion, netconvert_binary

    netconvert_binary()
    key = digest(*plain_network(plan).values(), repr(OPTIONS).encode(), conversion())
    return kept_network(key, lambda: stripped(network_of(plan, OPTIONS)))
