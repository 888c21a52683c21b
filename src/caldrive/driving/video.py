"""A video file: H.264 in MP4, which every browser plays. It appears whole or not at all."""

from __future__ import annotations

import os
from fractions import Fraction
from pathlib import Path
from types import TracebackType
from typing import Any

import av

from caldrive.datatypes import Image

FALLBACK_CODEC = "mpeg4"  # for builds of FFmpeg without x264


class VideoWriter:
    """Frames (H, W, 3) of one even size in, one MP4 out. rate: frames in a second.

    Use it in a `with` block: the file takes its name at the block's end. After an error or without a frame there is
    none.
    """

    def __init__(self, path: Path, rate: float = 10.0) -> None:
        self.path, self.rate, self.frames = path, rate, 0
        self._temporary = path.with_name(f".{path.name}.{os.getpid()}.tmp")
        self._container: Any = None
        self._stream: Any = None

    def add(self, image: Image, times: int = 1) -> None:
        """Append a frame, or the same one several times."""
        if self._container is None:
            self._open(image)
        for _ in range(times):
            self._container.mux(self._stream.encode(av.VideoFrame.from_ndarray(image, format="rgb24")))
            self.frames += 1

    def _open(self, image: Image) -> None:
        self.path.parent.mkdir(parents=True, exist_ok=True)
        self._container = av.open(str(self._temporary), "w", format="mp4", options={"movflags": "+faststart"})
        codec = "libx264" if "libx264" in av.codecs_available else FALLBACK_CODEC
        self._stream = self._container.add_stream(codec, rate=Fraction(self.rate).limit_denominator(1000))
        self._stream.height, self._stream.width = image.shape[:2]
        self._stream.pix_fmt = "yuv420p"
        if codec == "libx264":
            self._stream.options = {"preset": "veryfast", "crf": "22"}
        else:
            self._stream.bit_rate = 4_000_000

    def __enter__(self) -> VideoWriter:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, tb: TracebackType | None) -> None:
        if self._container is None:
            return
        try:
            if kind is None:
                self._container.mux(self._stream.encode())
            self._container.close()
            if kind is None:
                os.replace(self._temporary, self.path)
        finally:
            self._temporary.unlink(missing_ok=True)
