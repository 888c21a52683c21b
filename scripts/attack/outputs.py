"""Looks at what an attempt wrote: nothing half-written, every file readable, every number one that can be."""

from __future__ import annotations

import csv
import gzip
import io
import json
import math
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import av
import numpy as np
import pyarrow.parquet as pq
from PIL import Image
from safetensors.numpy import load

Files = dict[str, tuple[int, int]]  # by name: when it was changed (ns), and its size
RANGES = {
    "throttle": (0, 1), "brake": (0, 1), "steer": (-1, 1), "speed": (0, 100), "time": (0, 1e7), "percent": (0, 100),
    "duration": (0, 1e7), "distance": (0, 1e7), "hazard_stop": (0, 1), "red_light": (0, 1), "speed_sign": (0, 90),
    "vehicle_distance": (0, 50), "weather": (1, 14), "off_lane": (0, 1), "true_hazard_stop": (0, 1),
    "true_red_light": (0, 1),
}  # fmt: skip
TORCHS_OWN = "torchinductor_"  # a folder that it keeps for other processes
NO_NUMBER = re.compile(r"(?<![\w./-])(nan|NaN|-?inf|Infinity|None)(?![\w./-])")


def snapshot(folder: Path) -> Files:
    """All files of a folder as they are now."""
    paths = (path for path in folder.rglob("*") if path.is_file() and not path.is_symlink())
    return {str(path.relative_to(folder)): ((stat := path.stat()).st_mtime_ns, stat.st_size) for path in paths}


def leftovers(folder: Path) -> list[str]:
    """Temporary files that nobody removed. folder: the one above where the attempt ran."""
    files = (str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file())
    return [name for name in files if name.endswith(".tmp") or (name.startswith("tmp/") and TORCHS_OWN not in name)]


def torn(work: Path, before: Files) -> Iterator[str]:
    """Files that were written and that nobody can read."""
    for name in changed(work, before):
        look = READERS.get(name.rpartition(".")[2])
        try:
            if look is not None:
                look(name, (work / name).read_bytes())
        except Exception as error:  # whatever a reader finds wrong
            yield f"{name}: {type(error).__name__}: {str(error)[:100]}"


def impossible(work: Path, before: Files) -> Iterator[str]:
    """Numbers in the written files that cannot be."""
    for name in changed(work, before):
        look = READERS.get(name.rpartition(".")[2])
        if look is None:
            continue
        for key, value in look(name, (work / name).read_bytes()):
            if isinstance(value, float) and not math.isfinite(value):
                yield f"{name}: {key} is {value}"
            low, high = RANGES.get(key, (-math.inf, math.inf))
            if isinstance(value, int | float) and not low <= value <= high:
                yield f"{name}: {key} is {value}"


def changed(work: Path, before: Files) -> list[str]:
    """The files that are new, or not as they were."""
    return sorted(name for name, state in snapshot(work).items() if before.get(name) != state)


Values = Iterator[tuple[str, Any]]


def leaves(values: Any, key: str = "") -> Values:
    """All values of nested JSON by the names that stand nearest to them."""
    if isinstance(values, dict):
        for name, value in values.items():
            yield from leaves(value, name)
    elif isinstance(values, list):
        for value in values:
            yield from leaves(value, key)
    else:
        yield key, values


def strict_json(text: bytes | str) -> Any:
    """JSON without NaN and Infinity."""

    def refuse(constant: str) -> float:
        raise ValueError(f"{constant} is no JSON")

    return json.loads(text, parse_constant=refuse)


def _json(name: str, content: bytes) -> Values:
    return leaves(strict_json(content))


def _lines(name: str, content: bytes) -> Values:
    if content and not content.endswith(b"\n"):
        raise ValueError("its last line is not whole")
    return leaves([strict_json(line) for line in content.splitlines()])


def _packed(name: str, content: bytes) -> Values:
    return leaves(strict_json(gzip.decompress(content)))


def _table(name: str, content: bytes) -> Values:
    rows = list(csv.DictReader(io.StringIO(content.decode())))
    return iter([(key, float(value)) for row in rows for key, value in row.items() if key in RANGES and value])


def _parquet(name: str, content: bytes) -> Values:
    rows = pq.read_table(io.BytesIO(content), page_checksum_verification=True).to_pylist()
    return leaves(rows)


def _tensors(name: str, content: bytes) -> Values:
    return iter(
        [(key, float(np.abs(value.astype(np.float64)).max(initial=0.0))) for key, value in load(content).items()]
    )


def _picture(name: str, content: bytes) -> Values:
    with Image.open(io.BytesIO(content)) as picture:
        picture.load()
    return iter(())


def _film(name: str, content: bytes) -> Values:
    with av.open(io.BytesIO(content), "r") as film:
        if not list(film.decode(video=0)):
            raise ValueError("it has no frame")
    return iter(())


def _page(name: str, content: bytes) -> Values:
    text = re.sub(r"<(script|style|svg)\b.*?</\1>|<[^>]*>", " ", content.decode(), flags=re.DOTALL)
    if name.endswith(".html") and "</html>" not in content.decode():
        raise ValueError("it has no end")
    return iter([("text", float("nan"))] if NO_NUMBER.search(text) else [])


READERS: dict[str, Callable[[str, bytes], Values]] = {
    "json": _json, "jsonl": _lines, "gz": _packed, "csv": _table, "parquet": _parquet, "safetensors": _tensors,
    "png": _picture, "jpg": _picture, "mp4": _film, "md": _page, "html": _page,
}  # fmt: skip
