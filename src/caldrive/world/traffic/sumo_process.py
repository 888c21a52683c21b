"""SUMO in this process: whose it is, how it is started, and what it refuses. It can hold one simulation at a time."""

from __future__ import annotations

import gc
import weakref
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import libsumo

from caldrive.world.roads.network import RoadNetwork

DRIVERS = Path(__file__).with_name("drivers.add.xml")
MODELS = (("compact", 4.2, 1.76), ("estate", 4.6, 1.8), ("van", 4.9, 1.95))  # name, length, width in m

_driving: weakref.ref[object] | None = None  # the traffic that libsumo simulates


def take_sumo(traffic: object) -> None:
    """Notes whose SUMO it is from now on. Raises RuntimeError where it is another's."""
    global _driving
    if _driving is not None and _driving() is not None:
        gc.collect()  # a world that nobody holds any more may still lie around
    if _driving is not None and _driving() is not None:
        raise RuntimeError(
            "found another world with traffic in this process, wanted none, as SUMO simulates one at a time: "
            "close() that world first, or give each world a process of its own"
        )
    _driving = weakref.ref(traffic)


def has_sumo(traffic: object) -> bool:
    """Whether it is this one's."""
    return _driving is not None and _driving() is traffic


def release_sumo(traffic: object) -> None:
    """Lets another have it, if it is this one's."""
    global _driving
    if has_sumo(traffic):
        _driving = None


def stop_sumo() -> None:
    """Ends the simulation of this process, if there is one."""
    global _driving
    _driving = None
    if libsumo.isLoaded():
        libsumo.close()


def load_sumo(roads: RoadNetwork, dt: float, seed: int) -> None:
    """Starts an empty simulation of a town, in the place of any other, with the kinds of cars that drive in it."""
    arguments = [
        "-n", str(roads.network), "--step-length", str(dt), "--seed", str(seed % 2**31), "--no-step-log",
        "--no-warnings", "--time-to-teleport", "-1", "--collision.action", "none", "--start",
        "--default.speeddev", "0.05", "--additional-files", str(DRIVERS),
    ]  # fmt: skip
    if libsumo.isLoaded():
        libsumo.load(arguments)
    else:
        libsumo.start(["sumo", *arguments])
    for name, length, width in MODELS:
        libsumo.vehicletype.copy("driver", name)
        libsumo.vehicletype.setLength(name, length)
        libsumo.vehicletype.setWidth(name, width)


@contextmanager
def one_sentence(town: str) -> Iterator[None]:
    """Says what SUMO refuses. Raises RuntimeError."""
    try:
        yield
    except (libsumo.TraCIException, libsumo.FatalTraCIError) as error:
        raise RuntimeError(
            f"found that SUMO cannot let cars drive in {town} ({error}), wanted traffic: "
            "give another map, or drive alone with --cars 0"
        ) from error
