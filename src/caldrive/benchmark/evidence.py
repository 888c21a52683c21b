"""What the report shows of an episode: its trace, and a still of each infraction and of an end without goal."""

from __future__ import annotations

import gzip
import zlib
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import simplejpeg

from caldrive.datatypes import CameraConfig, Image, Step
from caldrive.driving.referee import Referee
from caldrive.driving.trace import COLUMNS, Trace, episode_json
from caldrive.files import as_type, read_json
from caldrive.interfaces import World, is_recordable
from caldrive.results import EpisodeResult, Outcome

STILL = replace(CameraConfig(), width=480, height=212)
MOST = 4  # stills of one episode; more would show the same once more
JPEG = {"quality": 75, "colorspace": "RGB", "colorsubsampling": "420"}  # to be looked at, not learnt from


class Evidence:
    """Gathers it while an episode is driven. Where the world's cameras cannot be moved, the agent's image is kept."""

    def __init__(self, world: World, referee: Referee) -> None:
        self.world, self.referee, self.trace, self.stills = world, referee, Trace(), list[Image]()
        self._counted = 0  # infractions so far
        self._image: Image | None = None

    def add(self, step: Step) -> None:
        """One more step."""
        self.trace.add(step)
        self._image = step.observation.image
        if len(self.referee.infractions) > self._counted and len(self.stills) < MOST:
            self.stills.append(self._still())
        self._counted = len(self.referee.infractions)

    def _still(self) -> Image:
        if is_recordable(self.world):
            return self.world.images([STILL])[0]
        assert self._image is not None
        return np.ascontiguousarray(self._image)

    def files(self, key: str, result: EpisodeResult) -> dict[str, bytes]:
        """Trace and stills by their names in a benchmark's folder."""
        stills = list(self.stills)
        if result.outcome in (Outcome.TIMEOUT, Outcome.ABORTED) and len(stills) < MOST:
            stills.append(self._still())
        trace = {str(trace_path(Path(), key)): gzip.compress(episode_json(result, self.trace), mtime=0)}
        pictures = (simplejpeg.encode_jpeg(still, **JPEG) for still in stills)
        return trace | {f"stills/{key}-{k}.jpg": picture for k, picture in enumerate(pictures)}


def trace_path(folder: Path, key: str) -> Path:
    return folder / "traces" / f"{key}.json.gz"


def still_paths(folder: Path, key: str) -> list[Path]:
    """The stills that an episode left, in the order of its infractions; the last one may be its end."""
    return sorted((folder / "stills").glob(f"{key}-[0-9].jpg"))


def read_trace(folder: Path, key: str) -> dict[str, list[Any]] | None:
    """The columns of an episode's trace, None where it left none. Raises ValueError where it is damaged."""
    path = trace_path(folder, key)
    return dict(episode_values(path)["trace"]) if path.is_file() else None


def episode_values(path: Path) -> dict[str, Any]:
    """What a trace's file holds, `trace` at least. Raises ValueError where it is damaged."""
    content = path.read_bytes()
    try:
        values = read_json(gzip.decompress(content), dict[str, Any])
        columns = as_type(values.get("trace"), dict[str, list[Any]])
        if missing := [name for name in COLUMNS if name not in columns]:
            raise ValueError(f"it lacks {missing[0]}")
        if len(set(map(len, columns.values()))) != 1 or not columns["time"]:
            raise ValueError("its columns are empty or of different lengths")
        for name in ("time", "x", "y", "speed", "route_done"):
            as_type(columns[name], list[float])
        return values
    except (gzip.BadGzipFile, EOFError, zlib.error, ValueError) as error:
        raise ValueError(f"found a damaged trace {path} ({error}): remove it, then it is done without") from error
