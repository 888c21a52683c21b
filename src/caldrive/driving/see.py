"""What the network sees in a person's own pictures: a video with the affordances drawn in, and a table of them."""

from __future__ import annotations

import csv
import io
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from PIL import Image as Picture

from caldrive.affordances import SPECS
from caldrive.agents.rows import model_path
from caldrive.checks import require_within, require_writable_file
from caldrive.datatypes import Affordances, Command, Image, Observation
from caldrive.driving.pictures import USUAL_RATE, PictureSource, SourcePicture, open_source
from caldrive.driving.settings import SeeSettings
from caldrive.files import write_whole
from caldrive.interfaces import BadImage, Perception
from caldrive.perception.inference.predictor import NetworkPerception
from caldrive.progress import Progress, silent
from caldrive.recordings.writer import label_type, label_values
from caldrive.visualization.episode_video import VideoWriter
from caldrive.visualization.own_pictures import SeenFrames, SeenPicture

WARNING = "the network knows only caldrive's embedded towns"
FAR_OFF = 1.25  # as wide as the network's image for its height, or as narrow, by more than this looks distorted
RATE_FAR_OFF = 1.5  # pictures a second, many times those that the network learnt at
LONGEST_NAME = 40  # letters of a name in the caption
VALUE_ENDINGS = (".csv", ".parquet")
SCHEMA = pa.schema(
    [
        ("picture", pa.int64()),
        ("file", pa.string()),
        ("time", pa.float64()),
        *((spec.name, label_type(spec)) for spec in SPECS),
        ("note", pa.string()),
    ]
)


@dataclass(frozen=True)
class SeeReport:
    """What was written, of how many pictures, how many of these tell nothing, and what to know about the values."""

    video: Path
    values: Path
    pictures: int
    no_use: int
    notes: tuple[str, ...]


def see(settings: SeeSettings, progress: Progress = silent) -> SeeReport:
    """Runs the network on a video, a folder of pictures or one picture; writes a video and the affordances' values.

    The values have a row for each picture: its number from 0, its file, its time (s), the affordances in the units of
    `affordances.SPECS` (a speed sign of 0 stands for none), and a note; without numbers where a picture tells nothing.
    Raises ValueError, FileNotFoundError or OSError with what to type where it cannot be done.
    """
    values = settings.values or settings.out.with_suffix(".csv")
    _check_outputs(settings, values)
    require_within("--every", settings.every, 1, 1_000_000, 1)
    crop = None if settings.crop is None else parse_crop(settings.crop)
    source = open_source(settings.source, settings.every)
    network = NetworkPerception(model_path(settings.model), watchdog=False)
    size = network.network.config.image_width, network.network.config.image_height
    viewer = Viewer(network, size, Command(settings.command), crop)
    with VideoWriter(settings.out, rate=source.rate / source.every) as video:
        rows = _film(video, source, viewer, progress)
        if not rows:
            raise ValueError(f"found no picture in {settings.source}, wanted one at least: give another file")
        write_whole(values, _content(rows, values.suffix.lower()))  # within the block: without values there is no video
    notes = (f"{WARNING}: in other pictures its values may mean nothing", *viewer.notes, *_rate_notes(source))
    return SeeReport(settings.out, values, len(rows), sum(bool(row["note"]) for row in rows), notes)


def _check_outputs(settings: SeeSettings, values: Path) -> None:
    """Raises ValueError or OSError where a file cannot be written under its name, or would replace another kind."""
    require_writable_file(settings.out, "--out", ".mp4")
    if values.suffix.lower() not in VALUE_ENDINGS:
        raise ValueError(
            f"found --values {values}, wanted a name that ends in {' or '.join(VALUE_ENDINGS)}: "
            f"type --values {values.with_suffix('.csv')}"
        )
    require_writable_file(values, "--values", values.suffix.lower())
    if settings.out.resolve() == settings.source.resolve():
        raise ValueError(f"found that --out {settings.out} is the video to look at, wanted another name: give one")


def _film(video: VideoWriter, source: PictureSource, viewer: Viewer, progress: Progress) -> list[dict[str, Any]]:
    """Adds the pictures to the video; returns the values, one row for each."""
    frames = SeenFrames(f"{source.name[:LONGEST_NAME]}   {WARNING}", viewer.command)
    rows = []
    of = f" of 0-{source.count - 1}" if source.count else ""  # numbered from 0, as in the values
    for picture in source:
        label = f"{picture.number}{of}"
        progress(f"picture {label}", min(1.0, picture.number / source.count) if source.count else 0.0)
        seen = viewer.look(picture, label)
        video.add(frames.draw(seen))
        rows.append(_row(picture, seen))
    return rows


class Viewer:
    """Brings pictures into the network's size, (width, height), and looks at them one after the other.

    crop: the first row to keep and the one after the last, None for all rows. notes: what to know about the values.
    """

    def __init__(
        self, perception: Perception, size: tuple[int, int], command: Command, crop: tuple[int, int] | None = None
    ) -> None:
        self.perception, self.size, self.command, self.crop = perception, size, command, crop
        self.notes: tuple[str, ...] = ()
        perception.reset()

    def look(self, picture: SourcePicture, label: str) -> SeenPicture:
        """What the network sees in a picture, which comes after those before. Raises ValueError where the crop lies
        outside it."""
        rows = kept_rows(picture, self.crop)
        kept = picture.image[slice(*rows)]
        self.notes = self.notes or self._shape_notes(picture.image.shape[0], kept)
        network_image = at_size(kept, self.size)
        affordances, note = self._predict(Observation(picture.time, network_image, speed=0.0, command=self.command))
        return SeenPicture(label, picture.time, picture.image, rows, network_image, affordances, note)

    def _predict(self, observation: Observation) -> tuple[Affordances | None, str]:
        """The affordances, or None and why."""
        try:
            return self.perception.predict(observation), ""
        except BadImage as error:
            return None, str(error).partition(":")[0]

    def _shape_notes(self, height: int, kept: Image) -> tuple[str, ...]:
        """Says so where pictures have quite another shape than the network's image."""
        (rows, width), wanted = kept.shape[:2], self.size[0] / self.size[1]
        if 1 / FAR_OFF < width / rows / wanted < FAR_OFF:
            return ()
        fitting = min(height, round(width / wanted))
        first = (height - fitting) // 2
        text = f"{width} x {rows} pixels are squeezed into the network's {self.size[0]} x {self.size[1]}, another shape"
        advice = f": type --crop {first}:{first + fitting}, or rows like these" if fitting < height else ""
        return (text + advice,)


def kept_rows(picture: SourcePicture, crop: tuple[int, int] | None) -> tuple[int, int]:
    """The first row of a picture to keep and the one after the last. Raises ValueError where the crop lies outside."""
    height = picture.image.shape[0]
    if crop is None:
        return 0, height
    if crop[1] > height:
        which = picture.file or f"picture {picture.number}"
        raise ValueError(
            f"found --crop {crop[0]}:{crop[1]} where {which} has {height} rows, wanted rows within it: "
            f"type --crop {height // 5}:{height * 4 // 5}"
        )
    return crop


def at_size(image: Image, size: tuple[int, int]) -> Image:
    """An image in a size (width, height). Each pixel is the mean of what lies in it, as in the camera that the network
    learnt with."""
    return np.array(Picture.fromarray(image).resize(size, Picture.Resampling.BOX))


def parse_crop(text: str) -> tuple[int, int]:
    """The first row to keep and the one after the last. Raises ValueError for another text."""
    first, _, end = text.partition(":")
    if not (first.isdecimal() and end.isdecimal() and int(first) < int(end)):
        raise ValueError(f"found --crop {text}, wanted the first row and the one after the last: type --crop 120:480")
    return int(first), int(end)


def _rate_notes(source: PictureSource) -> tuple[str, ...]:
    """Says so where the pictures come much faster or slower than those that the network learnt with: it looks back."""
    rate = source.rate / source.every
    if 1 / RATE_FAR_OFF < rate / USUAL_RATE < RATE_FAR_OFF:
        return ()
    text = f"it looks at {rate:.3g} pictures a second, and learnt at {USUAL_RATE:.0f}"
    fitting = round(source.rate / USUAL_RATE)
    return (f"{text}: type --every {fitting}" if fitting > 1 and fitting != source.every else text,)


def _row(picture: SourcePicture, seen: SeenPicture) -> dict[str, Any]:
    told = label_values(seen.affordances) if seen.affordances else dict.fromkeys(spec.name for spec in SPECS)
    return {"picture": picture.number, "file": picture.file, "time": picture.time, **told, "note": seen.note}


def _content(rows: list[dict[str, Any]], ending: str) -> bytes:
    """A table as the bytes of a .csv or .parquet file."""
    if ending == ".csv":
        text = io.StringIO()
        writer = csv.DictWriter(text, SCHEMA.names, lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
        return text.getvalue().encode()
    content = io.BytesIO()
    pq.write_table(pa.Table.from_pylist(rows, schema=SCHEMA), content, compression="zstd")
    return content.getvalue()
