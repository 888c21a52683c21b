"""Keeps what the report shows of an episode: its trace, and a still of each infraction and of an end without goal."""

from __future__ import annotations

import gzip
import zlib
from dataclasses import replace
from pathlib import Path
from typing import Any

import simplejpeg

from caldrive.config import CameraConfig
from caldrive.datatypes import Image, Step
from caldrive.driving.referee import Referee
from caldrive.driving.trace import COLUMNS, Trace, episode_json
from caldrive.results import EpisodeResult, Outcome
from caldrive.typed import as_type, read_json
from caldrive.world.embedded import EmbeddedWorld

STILL = replace(CameraConfig(), width=480, height=212)
MOST = 4  # stills of one episode; more would show the same once more
JPEG = {"quality": 75, "colorspace": "RGB", "colorsubsampling": "420"}  # to be looked at, not learnt from


def trace_path(folder: Path, key: str) -> Path:
    return folder / "traces" / f"{key}.json.gz"


def read_trace(folder: Path, key: str) -> dict[str, list[Any]] | None:
    """The columns of an episode's trace, None where it left none. Raises ValueError where it is damaged."""
    path = trace_path(folder, key)
    return dict(episode_values(path)["trace"]) if path.is_file() else None


def episode_values(path: Path) -> dict[str, Any]:
    """What a trace's file holds, `trace` at least. Raises ValueError where it is damaged."""
    content = path.read_bytes()
    try:
        found = read_json(gzip.decompress(content), dict[str, Any])
        columns = as_type(found.get("trace"), dict[str, list[Any]])
        if missing := [name for name in COLUMNS if name not in columns]:
            raise ValueError(f"it lacks {missing[0]}")
        if len(set(map(len, columns.values()))) != 1 or not columns["time"]:
            raise ValueError("its columns are empty or of different lengths")
        for name in ("time", "x", "y", "speed", "route_done"):
            as_type(columns[name], list[float])
        return found
    except (gzip.BadGzipFile, EOFError, zlib.error, ValueError) as error:
        raise ValueError(f"found a damaged trace {path} ({error}): remove it, then it is done without") from error


def still_paths(folder: Path, key: str) -> list[Path]:
    """The stills that an episode left, in the order of its infractions; the last one may be its end."""
    return sorted((folder / "stills").glob(f"{key}-[0-9].jpg"))


class Witness:
    """Watches one episode in a world, and its referee."""

    def __init__(self, world: EmbeddedWorld, referee: Referee) -> None:
        self.world, self.referee, self.trace, self.stills = world, referee, Trace(), list[Image]()
        self._counted = 0  # infractions so far

    def add(self, step: Step) -> None:
        """One more step."""
        self.trace.add(step)
        if len(self.referee.infractions) > self._counted and len(self.stills) < MOST:
            self.stills += self.world.images([STILL])
        self._counted = len(self.referee.infractions)

    def files(self, key: str, result: EpisodeResult) -> dict[str, bytes]:
        """Trace and stills by their names in a benchmark's folder."""
        stills = list(self.stills)
        if result.outcome in (Outcome.TIMEOUT, Outcome.ABORTED) and len(stills) < MOST:
            stills += self.world.images([STILL])
        found = {str(trace_path(Path(), key)): gzip.compress(episode_json(result, self.trace), mtime=0)}
        pictures = (simplejpeg.encode_jpeg(still, **JPEG) for still in stills)
        return found | {f"stills/{key}-{k}.jpg": picture for k, picture in enumerate(pictures)}
