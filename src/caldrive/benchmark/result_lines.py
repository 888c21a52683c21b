"""The lines of a run: results.jsonl, one for each episode that is done, or the same compressed (results.jsonl.gz).

Lines are appended and never changed, so a run that was killed holds all that it had finished. A line that was damaged
later costs its own episode only: it is named, and the episode is driven again.
"""

from __future__ import annotations

import gzip
import os
import zlib
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypedDict

from caldrive.files import json_line, read_json, write_whole
from caldrive.results import result_from_values

RESULTS = "results.jsonl"
COMPRESSED = RESULTS + ".gz"


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
    path = folder / RESULTS
    if not path.is_file() and (folder / COMPRESSED).is_file():
        path = folder / COMPRESSED
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
    result_from_values(line["result"])
    for name, value in line["figures"].items():
        if value is None and "/" not in name:  # of affordances nothing is known where nothing was seen
            raise ValueError(f"{name} is no number")
    return dict(line)


def drop_damaged(folder: Path) -> tuple[str, ...]:
    """Writes the lines again without those that are damaged, whose episodes are then driven again; says which."""
    lines = read_lines(folder)
    if lines.damaged:
        write_whole(folder / RESULTS, b"".join(map(json_line, lines.by_trial.values())))
    return lines.damaged


def append_line(folder: Path, values: dict[str, Any]) -> None:
    """One more line, on the disk when this returns. Cuts off the rest of a line that was broken off."""
    with (folder / RESULTS).open("ab+") as file:
        file.seek(0)
        file.truncate(file.read().rfind(b"\n") + 1)
        file.write(json_line(values))
        file.flush()
        os.fsync(file.fileno())
