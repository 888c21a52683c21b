"""A recorded episode on disk, its format and its writer: one Parquet file, one row for each frame of each camera.

Images are JPEG bytes; a semantic image, where one was asked for, is a zipped byte a pixel. The scenario, the episode's
id and the version of the format lie as JSON in the schema's metadata.
"""

from __future__ import annotations

import io
import json
import zlib
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import simplejpeg
from numpy.typing import NDArray

from caldrive.datatypes import Affordances, Alternative, Command, Control, Image
from caldrive.files import write_whole
from caldrive.scenarios import Scenario, scenario_values

FORMAT_VERSION = 4
METADATA_KEY = b"caldrive"
MANIFEST = "manifest.json"  # of a folder of episodes: what was asked for
JPEG_QUALITY = 90
LABELS = tuple(f.name for f in fields(Affordances))

CONTROLS = tuple(f.name for f in fields(Control))

OTHER = ("relative_angle", "center_distance")

PLAIN = ("camera", "camera_left", "camera_yaw", "time", "speed", "junction")

SCHEMA = pa.schema(
    [
        ("episode", pa.string()),
        ("frame", pa.int64()),
        ("camera", pa.int64()),
        *((name, pa.float64()) for name in ("camera_left", "camera_yaw", "time", "speed")),
        ("command", pa.string()),
        ("junction", pa.bool_()),
        ("other_command", pa.string()),  # empty where no other one could be given
        *((f"other_{name}", pa.float64()) for name in OTHER),
        *((name, pa.int64() if name == "speed_sign" else pa.float64()) for name in LABELS),
        *((f"{kind}_{name}", pa.float64()) for kind in ("driven", "clean") for name in CONTROLS),
        ("image", pa.binary()),
    ]
)

SEMANTIC = pa.field("semantic", pa.binary())  # only in recordings that were asked for it


def episode_path(folder: Path, number: int) -> Path:
    """Where an episode of a folder lies."""
    return folder / f"episode-{number:05d}.parquet"


class EpisodeError(ValueError):
    """A recording cannot be read or written; the message says why."""


@dataclass(frozen=True)
class Frame:
    """One camera's view at one moment.

    index: number of the moment, from 0. camera: its id, with its lateral offset (m, + left) and yaw (rad, + left).
    affordances: the labels as of a car that stands where the camera looks from. driven: the control that moved the car,
    clean: what the driver wanted before any noise was added. semantic (H, W): the class of each pixel, by number.
    junction: whether the car is inside one, where no line is painted. other: what another command would ask for.
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
    other: Alternative | None = None


def _row(episode_id: str, frame: Frame, quality: int) -> dict[str, Any]:
    labels = asdict(frame.affordances) | {"speed_sign": frame.affordances.speed_sign or 0}
    driven = {f"driven_{name}": value for name, value in asdict(frame.driven).items()}
    clean = {f"clean_{name}": value for name, value in asdict(frame.clean).items()}
    plain = {name: getattr(frame, name) for name in PLAIN}
    other = {f"other_{name}": getattr(frame.other, name) if frame.other else 0.0 for name in OTHER}
    other["other_command"] = frame.other.command.value if frame.other else ""
    # 4:4:4 keeps the colour of lamps that are a pixel or two wide.
    jpeg = simplejpeg.encode_jpeg(np.ascontiguousarray(frame.image), quality, colorspace="RGB", colorsubsampling="444")
    named = {"episode": episode_id, "frame": frame.index, "command": frame.command.value, "image": jpeg}
    if frame.semantic is not None:
        named[SEMANTIC.name] = zlib.compress(frame.semantic.tobytes(), 1)
    return named | plain | other | labels | driven | clean


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
        header = {"version": FORMAT_VERSION, "id": self.id, "scenario": json.dumps(scenario_values(self.scenario))}
        schema = SCHEMA.append(SEMANTIC) if SEMANTIC.name in self._rows[0] else SCHEMA
        schema = schema.with_metadata({METADATA_KEY: json.dumps(header).encode()})
        columns = [name for name in schema.names if name != "image"]
        buffer = io.BytesIO()
        pq.write_table(
            pa.Table.from_pylist(self._rows, schema=schema),
            buffer,
            use_dictionary=["episode", "command", "other_command"],
            compression=dict.fromkeys(columns, "zstd") | {"image": "none"},
            write_page_checksum=True,  # a bit that turns over in an image mostly leaves a JPEG that can be decoded
        )
        write_whole(self.path, buffer.getvalue())
        self._rows = []

    def __enter__(self) -> EpisodeWriter:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, tb: TracebackType | None) -> None:
        if kind is None:
            self.close()
        self._rows = []
