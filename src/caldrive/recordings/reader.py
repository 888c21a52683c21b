"""Recorded episodes, read from their files and checked: types, ranges, and that no value is missing and no row there
twice."""

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
from caldrive.checks import require_picture_size
from caldrive.datatypes import Affordances, Alternative, Command, Control, Image
from caldrive.files import read_json
from caldrive.recordings.writer import (
    CONTROLS,
    FORMAT_VERSION,
    FRAME_COLUMNS,
    IMAGE,
    LABELS,
    METADATA_KEY,
    OTHER_LABELS,
    SCHEMA,
    SEMANTIC,
    EpisodeError,
    Frame,
)
from caldrive.scenarios import TOWNS, WEATHERS, Scenario, generated_town, scenario_from_values

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
MOST_ROWS = 2_000_000  # in a file; an hour of three cameras takes a twentieth


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
    """The image of each row; none where they were not asked for."""
    semantics: list[bytes] | None = None
    """Bytes compressed by zlib, one a pixel, for each row, where they were recorded and asked for."""

    def __len__(self) -> int:
        return len(self.columns["frame"])

    @property
    def key(self) -> str:
        """Tells this recording from others that use the same id."""
        return f"{self.id}/{self.scenario.town}/{self.scenario.weather}/{self.scenario.seed}"

    def image(self, i: int) -> Image:
        """Row i's image (H, W, 3), RGB. Raises EpisodeError where its bytes are damaged, or ask for too much memory."""
        try:
            height, width, *_ = simplejpeg.decode_jpeg_header(self.jpegs[i])
            require_picture_size("a picture", width, height)
            return np.asarray(simplejpeg.decode_jpeg(self.jpegs[i], colorspace="RGB"))
        except ValueError as error:
            raise EpisodeError(
                f"row {i} of {self.path} holds a damaged image ({error}): remove the file and record again"
            ) from error

    def semantic(self, i: int, size: tuple[int, int] | None = None) -> NDArray[np.uint8]:
        """Row i's semantic image (H, W); size: (H, W) where it is known. Raises EpisodeError where there is none that
        fits."""
        if self.semantics is None:
            raise EpisodeError(f"{self.path} has no semantic images: record with --semantic")
        try:
            height, width = size or self.image(i).shape[:2]
            classes = zlib.decompressobj().decompress(
                self.semantics[i], height * width + 1
            )  # no more than one too many
            return np.frombuffer(classes, np.uint8).reshape(height, width)
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
            command=Command(self.columns["command"][i]),
            affordances=self.affordances(i),
            driven=driven,
            clean=clean,
            image=self.image(i),
            semantic=self.semantic(i) if self.semantics is not None else None,
            other=self.other(i),
            **{name: value[name] for name in FRAME_COLUMNS},
        )

    def __iter__(self) -> Iterator[Frame]:
        return (self[i] for i in range(len(self)))


def read_episode(path: Path | str, semantic: bool = False, images: bool = True) -> Episode:
    """Read a recording. semantic: with the semantic images, if it has them; images: with the images, without which an
    episode takes a hundredth of the memory.

    Raises EpisodeError where the file is missing, damaged or of another kind.
    """
    path = Path(path)
    if not path.is_file():
        raise EpisodeError(f"there is no episode {path}: look for the name, or record one with `caldrive collect`")
    try:
        with pq.ParquetFile(path, page_checksum_verification=True) as file:
            header = _read_header(path, file.schema_arrow)
            _require_rows(path, file.metadata.num_rows)
            table = file.read(_wanted_columns(file.schema_arrow.names, images, semantic))
        scenario = scenario_from_values(read_json(header["scenario"], dict[str, Any]))
        _check_scenario(path, scenario)
        table = table.sort_by([("camera", "ascending"), ("frame", "ascending")])
        columns = {name: table[name].to_numpy() for name in SCHEMA.names if name != IMAGE}
        _check_values(path, table, columns)
        return Episode(
            path=path,
            id=str(header["id"]),
            scenario=scenario,
            columns=columns,
            jpegs=table[IMAGE].to_pylist() if images else [],
            semantics=table[SEMANTIC.name].to_pylist() if SEMANTIC.name in table.column_names else None,
        )
    except EpisodeError:
        raise
    except (pa.ArrowException, OSError, KeyError, TypeError, ValueError) as error:
        kind = type(error).__name__
        raise EpisodeError(f"{path} is damaged or no Parquet file ({kind}): remove it and record again") from error


def _wanted_columns(names: list[str], images: bool, semantic: bool) -> list[str]:
    """Of a file's columns those that are asked for."""
    wanted = {IMAGE: images, SEMANTIC.name: semantic}
    return [name for name in names if wanted.get(name, True)]


def _read_header(path: Path, schema: pa.Schema) -> dict[str, Any]:
    """What the schema's metadata say. Raises EpisodeError where the file is of another kind or format."""
    metadata = schema.metadata or {}
    if METADATA_KEY not in metadata:
        raise EpisodeError(f"{path} is a Parquet file, but no episode of caldrive: record one with `caldrive collect`")
    header = read_json(metadata[METADATA_KEY], dict[str, Any])
    version = header.get("version", "unknown")
    if version != FORMAT_VERSION:
        raise EpisodeError(f"{path} has the format {version}, this caldrive reads {FORMAT_VERSION}: record again")
    missing = [name for name in SCHEMA.names if name not in schema.names]
    if missing:
        raise EpisodeError(f"{path} lacks the column {missing[0]}: remove it and record again")
    return header


def _require_rows(path: Path, n: int) -> None:
    """Raises EpisodeError for none, and for more than there is memory for: packed they may take a few bytes."""
    if not 0 < n <= MOST_ROWS:
        raise EpisodeError(f"{path} has {n or 'no'} rows, 1 to {MOST_ROWS} can be: remove it and record again")


def _check_scenario(path: Path, scenario: Scenario) -> None:
    """Raises EpisodeError for conditions that no recorder knows."""
    if scenario.weather not in WEATHERS:
        raise EpisodeError(
            f"{path} has weather {scenario.weather}, {WEATHERS[0]} to {WEATHERS[-1]} can be: remove it and record again"
        )
    try:
        is_known = scenario.town in TOWNS or generated_town(scenario.town) or Path(scenario.town).suffix == ".xodr"
    except ValueError:  # a seed that cannot be
        is_known = False
    if not is_known:
        raise EpisodeError(
            f"{path} has town {scenario.town!r}, {', '.join(TOWNS)}, random:SEED or a map (.xodr) can be: "
            "remove it and record again"
        )


def _check_values(path: Path, table: pa.Table, columns: dict[str, NDArray[Any]]) -> None:
    """Raises EpisodeError where rows hold what no recorder writes."""
    if wrong := [*_wrong_types(table), *_wrong_values(columns)]:
        raise EpisodeError(f"{path} has values in {wrong[0]} that cannot be: remove it and record again")


def _wrong_types(table: pa.Table) -> Iterator[str]:
    """Columns of another type, or with holes."""
    schema = SCHEMA.append(SEMANTIC)
    for name in table.column_names:
        if table[name].type != schema.field(name).type or table[name].null_count:
            yield name


def _wrong_values(columns: dict[str, NDArray[Any]]) -> Iterator[str]:
    """Columns with values that cannot be, of which a row is there twice, or in which the time stands still."""
    yield from (name for name, column in columns.items() if column.dtype.kind == "f" and not np.isfinite(column).all())
    for name, (low, high) in RANGES.items():
        if not ((columns[name] >= low) & (columns[name] <= high)).all():
            yield name
    allowed = CLASSES | {"command": COMMANDS, "other_command": COMMANDS | {""}}
    yield from (name for name, values in allowed.items() if not set(columns[name]) <= values)
    steps = np.stack([columns["camera"], columns["frame"]])
    if np.unique(steps, axis=1).shape != steps.shape:
        yield "frame"
    time, camera = columns["time"], columns["camera"]
    if ((time[1:] <= time[:-1]) & (camera[1:] == camera[:-1])).any():
        yield "time"
