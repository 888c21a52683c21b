"""A recorded episode on disk: its format and its writer. One Parquet file, one row for each frame of each camera.

Images are JPEG bytes; a semantic image, where one was asked for, is one byte for each pixel, compressed by zlib. The
scenario, the episode's id and the version of the format lie as JSON in the schema's metadata.
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

from caldrive.affordances import CONDITIONAL, SPECS, AffordanceSpec
from caldrive.datatypes import Affordances, Alternative, Command, Control, Image
from caldrive.files import write_whole
from caldrive.scenarios import Scenario, scenario_values

FORMAT_VERSION = 4
METADATA_KEY = b"caldrive"
MANIFEST = "manifest.json"  # of a folder of episodes: what was asked for
JPEG_QUALITY = 90
LABELS = tuple(spec.name for spec in SPECS)
CONTROLS = tuple(field.name for field in fields(Control))
OTHER_LABELS = tuple(spec.name for spec in CONDITIONAL)  # what another command would ask for
IMAGE = "image"  # the column of the JPEGs
FRAME_COLUMNS = ("camera", "camera_left", "camera_yaw", "time", "speed", "junction")  # fields of a Frame, as they are


def label_type(spec: AffordanceSpec) -> pa.DataType:
    """Of an affordance's column: whole numbers for classes, such as the limits on signs, and floats for probabilities,
    m and rad."""
    return pa.int64() if spec.discrete and not spec.binary else pa.float64()


SCHEMA = pa.schema(
    [
        ("episode", pa.string()),
        ("frame", pa.int64()),
        ("camera", pa.int64()),
        *((name, pa.float64()) for name in ("camera_left", "camera_yaw", "time", "speed")),
        ("command", pa.string()),
        ("junction", pa.bool_()),
        ("other_command", pa.string()),  # empty where no other one could be given
        *((f"other_{name}", pa.float64()) for name in OTHER_LABELS),
        *((spec.name, label_type(spec)) for spec in SPECS),
        *((f"{kind}_{name}", pa.float64()) for kind in ("driven", "clean") for name in CONTROLS),
        (IMAGE, pa.binary()),
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
    """One camera's view in one step of an episode."""

    index: int
    """The number of the step, from 0."""
    time: float
    """s since the start of the episode."""
    speed: float
    """Of the car, m/s."""
    command: Command
    """What the navigation system asks for."""
    affordances: Affordances
    """The labels, as of a car that stands where the camera looks from."""
    driven: Control
    """The control that moved the car."""
    clean: Control
    """What the driver wanted, before any perturbation."""
    image: Image
    """(H, W, 3), RGB."""
    camera: int = 0
    """The number of the camera."""
    camera_left: float = 0.0
    """m to the left of the car's middle."""
    camera_yaw: float = 0.0
    """rad to the left."""
    semantic: NDArray[np.uint8] | None = None
    """(H, W), the class of each pixel, by number."""
    junction: bool = False
    """Whether the car is inside a junction, where no line is painted."""
    other: Alternative | None = None
    """What another command would ask for, if another one could be given."""


def label_values(affordances: Affordances) -> dict[str, Any]:
    """Affordances as a row has them: 0 for no speed sign."""
    return {name: 0 if value is None else value for name, value in asdict(affordances).items()}


def _row(episode_id: str, frame: Frame) -> dict[str, Any]:
    """A frame as a row of SCHEMA."""
    # 4:4:4 keeps the colour of lamps that are a pixel or two wide.
    image = np.ascontiguousarray(frame.image)
    jpeg = simplejpeg.encode_jpeg(image, JPEG_QUALITY, colorspace="RGB", colorsubsampling="444")
    row = {"episode": episode_id, "frame": frame.index, "command": frame.command.value, IMAGE: jpeg}
    row |= {name: getattr(frame, name) for name in FRAME_COLUMNS}
    row |= label_values(frame.affordances)
    row |= {f"driven_{name}": value for name, value in asdict(frame.driven).items()}
    row |= {f"clean_{name}": value for name, value in asdict(frame.clean).items()}
    row |= {f"other_{name}": getattr(frame.other, name) if frame.other else 0.0 for name in OTHER_LABELS}
    row["other_command"] = frame.other.command.value if frame.other else ""
    if frame.semantic is not None:
        row[SEMANTIC.name] = zlib.compress(frame.semantic.tobytes(), 1)
    return row


class EpisodeWriter:
    """Gathers frames and writes the file whole on `close`; as a context manager it discards them on an error.

    Frames of one step may come camera by camera. An existing file of that name is replaced.
    """

    def __init__(self, path: Path | str, scenario: Scenario, id: str = "") -> None:
        self.path = Path(path)
        self.scenario = scenario
        self.id = id or self.path.stem
        self._rows: list[dict[str, Any]] = []

    def append(self, frame: Frame) -> None:
        """One more frame."""
        self._rows.append(_row(self.id, frame))

    def close(self) -> None:
        """Write the file. Raises EpisodeError where no frame was appended."""
        if not self._rows:
            raise EpisodeError(f"{self.path} would be an episode without frames: append at least one before closing it")
        header = {"version": FORMAT_VERSION, "id": self.id, "scenario": json.dumps(scenario_values(self.scenario))}
        schema = SCHEMA.append(SEMANTIC) if SEMANTIC.name in self._rows[0] else SCHEMA
        schema = schema.with_metadata({METADATA_KEY: json.dumps(header).encode()})
        columns = [name for name in schema.names if name != IMAGE]
        buffer = io.BytesIO()
        pq.write_table(
            pa.Table.from_pylist(self._rows, schema=schema),
            buffer,
            use_dictionary=["episode", "command", "other_command"],
            compression=dict.fromkeys(columns, "zstd") | {IMAGE: "none"},
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
