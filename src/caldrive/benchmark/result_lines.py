"""The lines of a run: results.jsonl, one for each episode that is done, or the same compressed (results.jsonl.gz).

Lines are appended and never changed, so a run that was killed holds all that it had finished. A line that was damaged
later costs its own episode only: it is named, and the episode is driven again.
"""

from __future__ import annotations

import gzip
import math
import os
import zlib
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypedDict

from caldrive.benchmark.suites import is_key
from caldrive.datatypes import KMH
from caldrive.driving.referee import GOAL_RADIUS
from caldrive.files import json_line, read_json, write_whole
from caldrive.results import EpisodeResult, Outcome, result_from_values

RESULTS = "results.jsonl"
COMPRESSED = RESULTS + ".gz"
FASTEST = 100.0  # m/s
ONE_STEP = 1.0  # s, a generous one: the last step of an episode ends after its limit


class ResultLine(TypedDict):
    """What a line says of an episode. figures: those of `EpisodeMetrics`, by name."""

    key: str
    result: dict[str, Any]
    figures: dict[str, int | float | None]


@dataclass(frozen=True)
class ResultLines:
    """What a folder's lines say. damaged: a sentence for each line that is no use."""

    by_trial: dict[str, dict[str, Any]] = field(default_factory=dict)
    damaged: tuple[str, ...] = ()


def read_lines(folder: Path) -> ResultLines:
    """The lines of a folder. One that was being written when the run was killed does not count.

    Raises ValueError where a compressed file cannot be unpacked.
    """
    path = folder / (COMPRESSED if _is_compressed(folder) else RESULTS)
    lines, damaged = dict[str, dict[str, Any]](), []
    for number, text in enumerate(_content(path).split(b"\n")[:-1], start=1):
        try:
            line = _read_line(text)
            if line["key"] in lines:
                raise ValueError(f"{line['key']} is there twice")
            lines[line["key"]] = line
        except ValueError as error:
            damaged.append(f"line {number} of {path} is damaged ({error})")
    return ResultLines(lines, tuple(damaged))


def _is_compressed(folder: Path) -> bool:
    return (folder / COMPRESSED).is_file() and not (folder / RESULTS).is_file()


def _content(path: Path) -> bytes:
    if not path.is_file():
        return b""
    if path.suffix != ".gz":
        return path.read_bytes()
    try:
        return gzip.decompress(path.read_bytes())
    except (EOFError, zlib.error, gzip.BadGzipFile) as error:
        raise ValueError(f"found that {path} is damaged ({error}), wanted results: give another folder") from error


def _read_line(text: bytes) -> dict[str, Any]:
    """One line, as a `ResultLine`. Raises ValueError for anything else."""
    line = read_json(text, ResultLine)
    if not is_key(line["key"]):
        raise ValueError(f"{line['key']!r} is no key")
    _check_possible(result_from_values(line["result"]))
    for name, value in line["figures"].items():
        if value is None and "/" not in name:  # of affordances nothing is known where nothing was seen
            raise ValueError(f"{name} is no number")
        if value is not None and not 0 <= value <= (1 if name == "off_lane" else math.inf):
            raise ValueError(f"{name} is {value}")
    return dict(line)


def _check_possible(result: EpisodeResult) -> None:
    """Raises ValueError for what no drive gives, and so was written by hand."""
    start, goal = result.scenario.start, result.scenario.goal
    away = math.dist((start.x, start.y), (goal.x, goal.y))
    if result.outcome is Outcome.SUCCESS and result.distance < (away - GOAL_RADIUS) / 2:  # half: starts are moved a bit
        raise ValueError(f"it reached a goal {away:.0f} m away by driving {result.distance:.0f} m")
    if result.duration > result.scenario.time_limit + ONE_STEP:
        raise ValueError(f"it took {result.duration:g} s of {result.scenario.time_limit:g} s")
    if result.distance > FASTEST * (result.duration + ONE_STEP):
        raise ValueError(f"it drove {result.distance:g} m in {result.duration:g} s")
    if not (0 <= result.speeding <= 1 and 0 <= result.worst_excess < FASTEST / KMH):
        raise ValueError(f"it was too fast for {result.speeding:g} of the time, by {result.worst_excess:g} km/h")
    for infraction in (*result.infractions, *result.touches):
        if not 0 <= infraction.time <= result.duration + ONE_STEP:
            raise ValueError(f"a rule was broken at {infraction.time:g} s of {result.duration:g} s")


def has_lines(folder: Path) -> bool:
    """Whether there is any line, sound or damaged."""
    lines = read_lines(folder)
    return bool(lines.by_trial or lines.damaged)


def make_appendable(folder: Path) -> None:
    """Writes results.jsonl again where it has damaged lines, whose episodes are then driven again, and where there is
    only the compressed file, whose lines a new results.jsonl would hide."""
    lines = read_lines(folder)
    if lines.damaged or _is_compressed(folder):
        write_whole(folder / RESULTS, b"".join(map(json_line, lines.by_trial.values())))


def append_line(folder: Path, values: dict[str, Any]) -> None:
    """One more line, on the disk when this returns. Cuts off the rest of a line that was broken off."""
    with (folder / RESULTS).open("ab+") as file:
        file.seek(0)
        file.truncate(file.read().rfind(b"\n") + 1)
        file.write(json_line(values))
        file.flush()
        os.fsync(file.fileno())
