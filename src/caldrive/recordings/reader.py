"""Recorded episodes, read from their files and checked: types, ranges, and that no row is missing or there twice."""

from __future__ import annotations

import math
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import simplejpeg
from numpy.typing import NDArray

from caldrive.affordances import CONDITIONAL, CONTINUOUS, DISCRETE
from caldrive.datatypes import Affordances, Alternative, Command, Control, Image
from caldrive.files import read_json
from caldrive.recordings.writer import (
    CONTROLS,
    FORMAT_VERSION,
    LABELS,
    METADATA_KEY,
    OTHER_LABELS,
    SCHEMA,
    SEMANTIC,
    EpisodeError,
    Frame,
)
from caldrive.scenarios import Scenario, scenario_from_values

RANGES = {  # of what a recorder writes, or nearly: no car drives 100 m/s, and no camera is 10 m beside it
    **{spec.name: (spec.low, spec.high) for spec in CONTINUOUS},
    **{f"other_{spec.name}": (spec.low, spec.high) for spec in CONDITIONAL},
    "camera_left": (-10.0, 10.0),
    "camera_yaw": (-math.pi, math.pi),
    "frame": (0, math.inf),
    "camera": (0, math.inf),
    "time": (0.0, math.inf),
    "speed": (0.0, 100.0),
    **{f"{kind}_{name}": (0.0, 1.0) for kind in ("driven", "clean") for name in ("throttle", "brake")},
    **{f"{kind}_steer": (-1.0, 1.0) for kind in ("driven", "clean")},
}
CLASSES = {spec.name: set(spec.classes) for spec in DISCRETE}
COMMANDS = {command.value for command in Command}


@dataclass(frozen=True)
class Episode:
    """A recording in memory: columns (N,) by name, images still as JPEG."""

    path: Path
    """The file."""
    id: str
    """The episode's name."""
    scenario: Scenario
    """The conditions in which it was driven."""
    columns: dict[str, NDArray[Any]]
    """(N,) each: episode, frame, camera, camera_left, camera_yaw, time, speed, command (the values of `Command`),
    junction, other_command (empty for none) with its other_relative_angle and other_center_distance, the six labels
    (speed_sign is 0 for none), driven_* and clean_* throttle, brake, steer. Sorted by camera, then by frame."""
    jpegs: list[bytes]
    """The image of each row."""
    semantics: list[bytes] | None = None
    """Bytes compressed by zlib, one a pixel, for each row, where they were recorded and asked for."""

    def __len__(self) -> int:
        return len(self.jpegs)

    @property
    def key(self) -> str:
        """Tells this recording from others that use the same id."""
        return f"{self.id}/{self.scenario.town}/{self.scenario.weather}/{self.scenario.seed}"

    def image(self, i: int) -> Image:
        """Row i's image (H, W, 3), RGB. Raises EpisodeError where its bytes are damaged."""
        try:
            return np.asarray(simplejpeg.decode_jpeg(self.jpegs[i], colorspace="RGB"))
        except ValueError as error:
            raise EpisodeError(
                f"row {i} of {self.path} holds a damaged image: remove the file and record again"
            ) from error

    def semantic(self, i: int, size: tuple[int, int] | None = None) -> NDArray[np.uint8]:
        """Row i's semantic image (H, W); size: (H, W) where it is known. Raises EpisodeError where there is none that
        fits."""
        if self.semantics is None:
            raise EpisodeError(f"{self.path} has no semantic images: record with --semantic")
        try:
            return np.frombuffer(zlib.decompress(self.semantics[i]), np.uint8).reshape(size or self.image(i).shape[:2])
        except (zlib.error, ValueError) as error:
            raise EpisodeError(f"row {i} of {self.path} holds a damaged semantic image: record again") from error

    def affordances(self, i: int) -> Affordances:
        """Row i's labels."""
        values = {name: self.columns[name][i].item() for name in LABELS}
        return Affordances(**(values | {"speed_sign": values["speed_sign"] or None}))

    def other(self, i: int) -> Alternative | None:
        """What another command would ask for in row i, if another one could be given."""
        if not self.columns["other_command"][i]:
            return None
        values = {name: self.columns[f"other_{name}"][i].item() for name in OTHER_LABELS}
        return Alternative(Command(self.columns["other_command"][i]), **values)

    def __getitem__(self, i: int) -> Frame:
        """Row i with its image decoded."""
        if not -len(self) <= i < len(self):
            raise IndexError(f"row {i} of {self.path} was asked for, but it has {len(self)}")
        value = {name: column[i].item() for name, column in self.columns.items() if column.dtype != object}
        driven, clean = (Control(*(value[f"{kind}_{name}"] for name in CONTROLS)) for kind in ("driven", "clean"))
        return Frame(
            index=value["frame"],
            time=value["time"],
            speed=value["speed"],
            command=Command(self.columns["command"][i]),
            affordances=self.affordances(i),
            driven=driven,
            clean=clean,
            image=self.image(i),
            camera=value["camera"],
            camera_left=value["camera_left"],
            camera_yaw=value["camera_yaw"],
            semantic=self.semantic(i) if self.semantics is not None else None,
            junction=value["junction"],
            other=self.other(i),
        )

    def __iter__(self) -> Iterator[Frame]:
        return (self[i] for i in range(len(self)))


def read_episode(path: Path | str, semantic: bool = False) -> Episode:
    """Read a recording; semantic: with the semantic images, if it has them.

    Raises EpisodeError where the file is missing, damaged or of another kind.
    """
    path = Path(path)
    if not path.is_file():
        raise EpisodeError(f"there is no episode {path}: look for the name, or record one with `caldrive collect`")
    try:
        names = [name for name in pq.read_schema(path).names if semantic or name != SEMANTIC.name]
        table = pq.read_table(path, columns=names, memory_map=False, partitioning=None, page_checksum_verification=True)
        header = _read_header(path, table.schema)
        scenario = scenario_from_values(read_json(header["scenario"], dict[str, Any]))
        table = table.sort_by([("camera", "ascending"), ("frame", "ascending")])
        columns = {name: table[name].to_numpy() for name in SCHEMA.names if name != "image"}
        _check_values(path, table, columns)
        return Episode(
            path=path,
            id=str(header["id"]),
            scenario=scenario,
            columns=columns,
            jpegs=table["image"].to_pylist(),
            semantics=table[SEMANTIC.name].to_pylist() if SEMANTIC.name in names else None,
        )
    except EpisodeError:
        raise
    except (pa.ArrowException, OSError, KeyError, TypeError, ValueError) as error:
        kind = type(error).__name__
        raise EpisodeError(f"{path} is damaged or no Parquet file ({kind}): remove it and record again") from error


def _read_header(path: Path, schema: pa.Schema) -> dict[str, Any]:
    """What the schema's metadata say. Raises EpisodeError where the file is of another kind or format."""
    metadata = schema.metadata or {}
    if METADATA_KEY not in metadata:
        raise EpisodeError(f"{path} is a Parquet file, but no episode of caldrive: record one with `caldrive collect`")
    header = read_json(metadata[METADATA_KEY], dict[str, Any])
    version = header.get("version")
    if version != FORMAT_VERSION:
        raise EpisodeError(f"{path} has format {version}, this caldrive reads {FORMAT_VERSION}: record again")
    missing = [name for name in SCHEMA.names if name not in schema.names]
    if missing:
        raise EpisodeError(f"{path} lacks the column {missing[0]}: remove it and record again")
    return header


def _check_values(path: Path, table: pa.Table, columns: dict[str, NDArray[Any]]) -> None:
    """Raises EpisodeError where rows are missing or hold what no recorder writes."""
    wrong = [*_wrong_types(table), *_wrong_values(columns)]
    if not len(table) or wrong:
        what = f"values in {wrong[0]} that cannot be" if wrong else "no rows"
        raise EpisodeError(f"{path} has {what}: remove it and record again")


def _wrong_types(table: pa.Table) -> Iterator[str]:
    """Columns of another type, or with holes."""
    schema = SCHEMA.append(SEMANTIC)
    for name in table.column_names:
        if table[name].type != schema.field(name).type or table[name].null_count:
            yield name


def _wrong_values(columns: dict[str, NDArray[Any]]) -> Iterator[str]:
    """Columns with values that cannot be, or of which a row is there twice."""
    yield from (name for name, column in columns.items() if column.dtype.kind == "f" and not np.isfinite(column).all())
    for name, (low, high) in RANGES.items():
        if not ((columns[name] >= low) & (columns[name] <= high)).all():
            yield name
    allowed = CLASSES | {"command": COMMANDS, "other_command": COMMANDS | {""}}
    yield from (name for name, values in allowed.items() if not set(columns[name]) <= values)
    steps = np.stack([columns["camera"], columns["frame"]])
    if np.unique(steps, axis=1).shape != steps.shape:
        yield "frame"
