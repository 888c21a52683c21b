"""What a server serves, and where."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from pathlib import Path

from caldrive.checks import MOST_SEED, require_limits

LIMITS = {
    "port": (1, 65534), "weather": (1, 14), "cars": (0, math.inf), "people": (0, math.inf), "seed": (0, MOST_SEED),
}  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class ServerSettings:
    """The options of `caldrive serve-carla`."""

    town: str = "town01"
    """town01, town02, random:SEED or an OpenDRIVE file."""
    host: str = "127.0.0.1"
    """The address to listen on; 0.0.0.0 lets other machines in, and there is no password."""
    port: int = 2000
    """The port for calls; the next one is for streams."""
    maps: Path | None = None
    """A folder with OpenDRIVE files, such as CARLA's Town01.xodr, that clients may load by name."""
    weather: int = 1
    """1 to 14, CARLA's; clients may set another."""
    cars: int = 0
    """Cars that SUMO drives; clients see them as vehicles."""
    people: int = 0
    """People on the sidewalks; clients see them as walkers."""
    seed: int = 0
    """For cars, people and lights."""
    record: Path | None = None
    """Also write what clients do to a file (.mcap) for Foxglove, Lichtblick or Rerun; it is there when the server
    ends."""
    keep: bool = False
    """Keep what a client spawned and set when it has gone, as CARLA does."""

    def __post_init__(self) -> None:
        """Raises ValueError for what cannot be, before a town is loaded."""
        require_limits(asdict(self), LIMITS, {"port": 2000, "weather": 1, "cars": 20, "people": 50, "seed": 0})
