"""A recorded episode on disk, the only home of the format: one Parquet file, one row for each frame of each camera.

Images are JPEG bytes; a semantic image, where one was asked for, is a zipped byte a pixel. The scenario, the episode's
id and the version of the format lie as JSON in the schema's metadata.
"""

from __future__ import annotations

import io
import json
import zlib
from collections.abc import Iterator
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import simplejpeg
from numpy.typing import NDArray

from caldrive.datatypes import Affordances, Command, Control, Image, Scenario
from caldrive.files import write_whole
from caldrive.scenarios import scenario_from_json, scenario_to_json

FORMAT_VERSION = 2
METADATA_KEY = b"caldrive"
JPEG_QUALITY = 90
LABELS = tuple(f.name for f in fields(Affordances))
CONTROLS = tuple(f.name for f in fields(Control))
PLAIN = ("camera", "camera_left", "camera_yaw", "time", "speed", "junction")

SCHEMA = pa.schema(
    [
        ("episode", pa.string()),
        ("frame", pa.int64()),
        ("camera", pa.int64()),
        *((name, pa.float64()) for name in ("camera_left", "camera_yaw", "time", "speed")),
        ("command", pa.string()),
        ("junction", pa.bool_()),
        *((name, pa.int64() if name == "speed_sign" else pa.float64()) for name in LABELS),
        *((f"{kind}_{name}", pa.float64()) for kind in ("driven", "clean") for name in CONTROLS),
        ("image", pa.binary()),
    ]
)
SEMANTIC = pa.field("semantic", pa.binary())  # only in recordings that were asked for it


class EpisodeError(ValueError):
    """A recording cannot be read or written; the message says why."""


@dataclass(frozen=True)
class Frame:
    """One camera's view at one moment.

    index: number of the moment, from 0. camera: its id, with its lateral offset (m, + left) and yaw (rad, + left).
    affordances: the labels as of a car that stands where the camera looks from. driven: the control that moved the car,
    clean: what the driver wanted before any noise was added. semantic (H, W): the class of each pixel, by number.
    junction: whether the car is inside one, where no line is painted.
    """

    index: int
    time: float
    speed: float
    command: Command
    affordances: Affordances
    driven: Control
    clean: Control
    image: Image
    camera: int = 0
    camera_left: float = 0.0
    camera_yaw: float = 0.0
    semantic: NDArray[np.uint8] | None = None
    junction: bool = False


def _row(episode_id: str, frame: Frame, quality: int) -> dict[str, Any]:
    labels = asdict(frame.affordances) | {"speed_sign": frame.affordances.speed_sign or 0}
    driven = {f"driven_{name}": value for name, value in asdict(frame.driven).items()}
    clean = {f"clean_{name}": value for name, value in asdict(frame.clean).items()}
    plain = {name: getattr(frame, name) for name in PLAIN}
    # 4:4:4 keeps the colour of lamps that are a pixel or two wide.
    jpeg = simplejpeg.encode_jpeg(np.ascontiguousarray(frame.image), quality, colorspace="RGB", colorsubsampling="444")
    named = {"episode": episode_id, "frame": frame.index, "command": frame.command.value, "image": jpeg}
    if frame.semantic is not None:
        named[SEMANTIC.name] = zlib.compress(frame.semantic.tobytes(), 1)
    return named | plain | labels | driven | clean


class EpisodeWriter:
    """Gathers frames and writes the file whole on `close`; as a context manager it discards them on an error.

    Frames of one moment may come camera by camera. An existing file of that name is replaced.
    """

    def __init__(self, path: Path | str, scenario: Scenario, id: str = "", quality: int = JPEG_QUALITY) -> None:
        self.path = Path(path)
        self.scenario = scenario
        self.id = id or self.path.stem
        self.quality = quality
        self._rows: list[dict[str, Any]] = []

    def append(self, frame: Frame) -> None:
        self._rows.append(_row(self.id, frame, self.quality))

    def close(self) -> None:
        """Write the file. Raises EpisodeError where no frame was appended."""
        if not self._rows:
            raise EpisodeError(f"{self.path} would be an episode without frames: append at least one before closing it")
        header = {"version": FORMAT_VERSION, "id": self.id, "scenario": scenario_to_json(self.scenario)}
        schema = SCHEMA.append(SEMANTIC) if SEMANTIC.name in self._rows[0] else SCHEMA
        schema = schema.with_metadata({METADATA_KEY: json.dumps(header).encode()})
        columns = [name for name in schema.names if name != "image"]
        buffer = io.BytesIO()
        pq.write_table(
            pa.Table.from_pylist(self._rows, schema=schema),
            buffer,
            use_dictionary=["episode", "command"],
            compression=dict.fromkeys(columns, "zstd") | {"image": "none"},
        )
        write_whole(self.path, buffer.getvalue())
        self._rows = []

    def __enter__(self) -> EpisodeWriter:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, tb: TracebackType | None) -> None:
        if kind is None:
            self.close()
        self._rows = []


@dataclass(frozen=True)
class Episode:
    """A recording in memory: columns (N,) by name, images still as JPEG.

    columns: episode, frame, camera, camera_left, camera_yaw, time, speed, command (the values of `Command`), junction,
    the six labels (speed_sign is 0 for none), driven_* and clean_* throttle, brake, steer. Rows are sorted by camera,
    then by frame. semantics: a zipped byte a pixel for each row, where they were recorded and asked for.
    """

    path: Path
    id: str
    scenario: Scenario
    columns: dict[str, NDArray[Any]]
    jpegs: list[bytes]
    semantics: list[bytes] | None = None

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

    def __getitem__(self, i: int) -> Frame:
        """Row i with its image decoded."""
        if not -len(self) <= i < len(self):
            raise IndexError(f"row {i} of {self.path} was asked for, but it has {len(self)}")
        value = {name: column[i].item() for name, column in self.columns.items() if column.dtype != object}
        driven, clean = (Control(*(value[f"{kind}_{name}"] for name in CONTROLS)) for kind in ("driven", "clean"))
        return Frame(
            value["frame"],
            value["time"],
            value["speed"],
            Command(self.columns["command"][i]),
            self.affordances(i),
            driven,
            clean,
            self.image(i),
            value["camera"],
            value["camera_left"],
            value["camera_yaw"],
            self.semantic(i) if self.semantics is not None else None,
            value["junction"],
        )

    def __iter__(self) -> Iterator[Frame]:
        return (self[i] for i in range(len(self)))


def _header(path: Path, schema: pa.Schema) -> dict[str, Any]:
    metadata = schema.metadata or {}
    if METADATA_KEY not in metadata:
        raise EpisodeError(f"{path} is a Parquet file, but no episode of caldrive: record one with `caldrive collect`")
    header: dict[str, Any] = json.loads(metadata[METADATA_KEY])
    if header["version"] != FORMAT_VERSION:
        found = header["version"]
        raise EpisodeError(f"{path} has format {found}, this caldrive reads {FORMAT_VERSION}: record again")
    missing = [name for name in SCHEMA.names if name not in schema.names]
    if missing:
        raise EpisodeError(f"{path} lacks the column {missing[0]}: remove it and record again")
    return header


def read_episode(path: Path | str, semantic: bool = False) -> Episode:
    """Read a recording; semantic: with the semantic images, if it has them.

    Raises EpisodeError where the file is missing, damaged or of another kind.
    """
    path = Path(path)
    if not path.is_file():
        raise EpisodeError(f"there is no episode {path}: look for the name, or record one with `caldrive collect`")
    try:
        names = pq.read_schema(path).names
        names = [name for name in names if semantic or name != SEMANTIC.name]
        table = pq.read_table(path, columns=names, memory_map=False, partitioning=None)
        header = _header(path, table.schema)
        scenario = scenario_from_json(header["scenario"])
        table = table.sort_by([("camera", "ascending"), ("frame", "ascending")])
        columns = {name: table[name].to_numpy() for name in SCHEMA.names if name != "image"}
        _check_values(path, table, columns)
        semantics = table[SEMANTIC.name].to_pylist() if SEMANTIC.name in names else None
        return Episode(path, str(header["id"]), scenario, columns, table["image"].to_pylist(), semantics)
    except EpisodeError:
        raise
    except (pa.ArrowException, OSError, KeyError, TypeError, ValueError) as error:
        kind = type(error).__name__
        raise EpisodeError(f"{path} is damaged or no Parquet file ({kind}): remove it and record again") from error


def _check_values(path: Path, table: pa.Table, columns: dict[str, NDArray[Any]]) -> None:
    """Raises EpisodeError where rows are missing or hold what no recorder writes."""
    wrong = [name for name in SCHEMA.names if table[name].null_count]
    wrong += [name for name, c in columns.items() if c.dtype.kind == "f" and not np.isfinite(c).all()]
    wrong += ["command"] * (not set(columns["command"]) <= {command.value for command in Command})
    if not len(table) or wrong:
        what = f"values in {wrong[0]} that cannot be" if wrong else "no rows"
        raise EpisodeError(f"{path} has {what}: remove it and record again")
