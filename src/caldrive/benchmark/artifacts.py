"""What a benchmark keeps of an episode beside its line of results, for the report and the search for failures: its
trace, and a still picture of each infraction and of an end without the goal."""

from __future__ import annotations

import gzip
import math
import zlib
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import simplejpeg

from caldrive.checks import require_picture_size
from caldrive.datatypes import CameraConfig, Image, Step
from caldrive.driving.referee import Referee
from caldrive.driving.trace import COLUMNS, Trace, episode_json
from caldrive.files import as_type, read_json
from caldrive.interfaces import World, is_recordable
from caldrive.results import WITHOUT_END, EpisodeResult

STILL = replace(CameraConfig(), width=480, height=212)
MAX_STILLS = 4  # of one episode; more would show the same again
JPEG = {"quality": 75, "colorspace": "RGB", "colorsubsampling": "420"}  # to be looked at, not to train on
KINDS: dict[str, Any] = {  # of the columns of a trace; the others hold numbers, or null where nothing is known
    **dict.fromkeys(("time", "x", "y", "speed", "route_done"), list[float]), "command": list[str],
    "state": list[str | None],
}  # fmt: skip
LIMITS = {"time": (0.0, math.inf), "throttle": (0.0, 1.0), "brake": (0.0, 1.0), "steer": (-1.0, 1.0)}


class EpisodeArtifacts:
    """Collects the artifacts while an episode is driven.

    Where the world's cameras cannot be moved, the stills are the images that the agent sees.
    """

    def __init__(self, world: World, referee: Referee) -> None:
        self.world, self.referee, self.trace, self.stills = world, referee, Trace(), list[Image]()
        self._infractions = 0  # so far
        self._image: Image | None = None

    def add(self, step: Step) -> None:
        """One more step, which the referee has seen."""
        self.trace.add(step)
        self._image = step.observation.image
        if len(self.referee.infractions) > self._infractions and len(self.stills) < MAX_STILLS:
            self.stills.append(self._still())
        self._infractions = len(self.referee.infractions)

    def _still(self) -> Image:
        """What the car sees now (H, W, 3)."""
        if is_recordable(self.world):
            return self.world.images([STILL])[0]
        assert self._image is not None
        return np.ascontiguousarray(self._image)

    def files(self, key: str, result: EpisodeResult) -> dict[str, bytes]:
        """Trace and stills by their names in a run's folder. key: the trial's."""
        stills = list(self.stills)
        if result.outcome in WITHOUT_END and len(stills) < MAX_STILLS:
            stills.append(self._still())
        pictures = [simplejpeg.encode_jpeg(still, **JPEG) for still in stills]
        return artifact_files(key, episode_json(result, self.trace), pictures)


def artifact_files(key: str, episode: bytes, stills: Iterable[bytes]) -> dict[str, bytes]:
    """A trial's trace and stills by their names in a run's folder. episode: the trace as JSON; stills: JPEGs."""
    trace = {str(trace_path(Path(), key)): gzip.compress(episode, mtime=0)}
    return trace | {f"stills/{key}-{k}.jpg": still for k, still in enumerate(stills)}


def trace_path(folder: Path, key: str) -> Path:
    """Where a trial's trace lies in a run's folder."""
    return folder / "traces" / f"{key}.json.gz"


def still_paths(folder: Path, key: str) -> list[Path]:
    """A trial's stills, in the order of its infractions; the last one may be its end."""
    return sorted((folder / "stills").glob(f"{key}-[0-9].jpg"))


def read_still(path: Path) -> bytes:
    """A still as JPEG. Raises ValueError where it is damaged."""
    content = path.read_bytes()
    try:
        height, width, *_ = simplejpeg.decode_jpeg_header(content)
        require_picture_size(str(path), width, height)
        simplejpeg.decode_jpeg(content, strict=True)
        return content
    except ValueError as error:
        raise ValueError(f"found a damaged still {path} ({error}): remove it, then it is done without") from error


def read_trace(folder: Path, key: str) -> dict[str, list[Any]] | None:
    """The columns of a trial's trace, None where it left none. Raises ValueError where it is damaged."""
    path = trace_path(folder, key)
    if not path.is_file():
        return None
    columns: dict[str, list[Any]] = read_trace_file(path)["trace"]
    return columns


def read_trace_file(path: Path) -> dict[str, Any]:
    """What a trace's file holds, `trace` at least. Raises ValueError where it is damaged."""
    content = path.read_bytes()
    try:
        values = read_json(gzip.decompress(content), dict[str, Any])
        _check_columns(as_type(values.get("trace"), dict[str, list[Any]]))
        return values
    except (gzip.BadGzipFile, EOFError, zlib.error, ValueError) as error:
        raise ValueError(f"found a damaged trace {path} ({error}): remove it, then it is done without") from error


def _check_columns(columns: dict[str, list[Any]]) -> None:
    """Raises ValueError where a trace lacks a column or a row, or holds something else."""
    if missing := [name for name in COLUMNS if name not in columns]:
        raise ValueError(f"it lacks {missing[0]}")
    if len(set(map(len, columns.values()))) != 1 or not columns["time"]:
        raise ValueError("its columns are empty or of different lengths")
    for name in COLUMNS:
        as_type(columns[name], KINDS.get(name, list[float | bool | None]))
    for name, (low, high) in LIMITS.items():
        for value in as_type(columns.get(name, []), list[float | None]):
            if value is not None and not low <= value <= high:
                raise ValueError(f"its {name} is {value}, where {low} to {high} is possible")
