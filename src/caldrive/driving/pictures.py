"""A person's own pictures, one after the other: the frames of a video, or the files of a folder."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Protocol

import av
import numpy as np
from PIL import Image as Picture
from PIL import ImageOps

from caldrive.checks import TooLargeError, require_picture_size
from caldrive.datatypes import DT, Image

Picture.MAX_IMAGE_PIXELS = None  # Pillow's own limit, which only warns; ours comes before anything is decoded
ENDINGS = (".png", ".jpg", ".jpeg")
USUAL_RATE = 1 / DT  # pictures a second where nothing says how many: as the network learnt


@dataclass(frozen=True)
class SourcePicture:
    """One picture (H, W, 3). number: from 0; file: its name in a folder, empty in a video; time in s."""

    number: int
    file: str
    time: float
    image: Image


class PictureSource(Protocol):
    """Pictures in their order: the first one, and from there every so many-th."""

    @property
    def every(self) -> int:
        """How many pictures from one that is given to the next; those between are not looked at."""
        ...

    @property
    def name(self) -> str:
        """For captions."""
        ...

    @property
    def rate(self) -> float:
        """Pictures a second, of all."""
        ...

    @property
    def count(self) -> int | None:
        """How many there are in all, None where that is not known."""
        ...

    def __iter__(self) -> Iterator[SourcePicture]: ...


class PictureFolder:
    """The pictures of a folder (.png, .jpg, .jpeg), by name: 2.png comes before 10.png."""

    rate = USUAL_RATE

    def __init__(self, name: str, files: list[Path], every: int = 1) -> None:
        self.name, self.files, self.every, self.count = name, sorted(files, key=_natural), every, len(files)

    def __iter__(self) -> Iterator[SourcePicture]:
        for number, file in islice(enumerate(self.files), 0, None, self.every):
            yield SourcePicture(number, file.name, number / self.rate, _read_picture(file))


def _natural(file: Path) -> list[str | int]:
    """A name with its numbers by value; texts and numbers alternate, so that any two can be compared."""
    return [int(part) if part.isdigit() else part for part in re.split(r"(\d+)", file.name)]


def _read_picture(file: Path) -> Image:
    try:
        with Picture.open(file) as picture:
            require_picture_size(str(file), *picture.size)
            return np.asarray(ImageOps.exif_transpose(picture).convert("RGB"))
    except TooLargeError:
        raise
    except (OSError, ValueError, SyntaxError) as error:
        raise ValueError(
            f"found that {file} cannot be read as a picture, wanted a sound one: replace it, or take it out"
        ) from error


class VideoFile:
    """The frames of a video's first picture stream, upright. Raises ValueError where a file is no video."""

    def __init__(self, path: Path, every: int = 1) -> None:
        self.path, self.name, self.every = path, path.name, every
        with self._opened() as container:
            stream = container.streams.video[0] if container.streams.video else None
            if stream is None or stream.codec_context is None:  # pictures in a format that nobody knows
                raise ValueError(f"found no pictures in {path} that can be read, wanted a video: give another file")
            require_picture_size(str(path), stream.width, stream.height)
            self.rate = float(stream.average_rate or stream.guessed_rate or USUAL_RATE)
            self.count = stream.frames or None

    def __iter__(self) -> Iterator[SourcePicture]:
        with self._opened() as container:
            for number, frame in islice(enumerate(container.decode(video=0)), 0, None, self.every):
                image: Image = frame.to_ndarray(format="rgb24").astype(np.uint8, copy=False)
                time = frame.time if frame.time is not None else number / self.rate
                yield SourcePicture(number, "", time, _upright(image, getattr(frame, "rotation", 0)))

    @contextmanager
    def _opened(self) -> Iterator[av.container.InputContainer]:
        try:
            with av.open(str(self.path)) as container:
                yield container
        except av.FFmpegError as error:
            raise ValueError(
                f"found that {self.path} cannot be read as a video, wanted a sound one such as an .mp4: "
                f"give another file, or a folder of pictures ({', '.join(ENDINGS)})"
            ) from error


def _upright(image: Image, degrees: int) -> Image:
    """The picture as a player shows it: telephones store it lying, with the angle (counter-clockwise) to turn it by."""
    return np.ascontiguousarray(np.rot90(image, round(degrees / 90)))


def open_source(path: Path, every: int = 1) -> PictureSource:
    """The pictures of a video, of a folder, or of one picture's file: every so many-th.

    Raises FileNotFoundError where there is nothing, ValueError where there is no picture in it.
    """
    if path.is_dir():
        files = [file for file in path.iterdir() if file.suffix.lower() in ENDINGS and not file.name.startswith(".")]
        if not files:
            raise ValueError(f"found no picture in {path}, wanted files that end in {', '.join(ENDINGS)}: give another")
        return PictureFolder(path.resolve().name, files, every)
    if not path.is_file():
        raise FileNotFoundError(f"found nothing at {path}, wanted a video or a folder of pictures: check the path")
    return PictureFolder(path.name, [path]) if path.suffix.lower() in ENDINGS else VideoFile(path, every)
