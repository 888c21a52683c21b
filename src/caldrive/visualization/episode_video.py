"""Videos: a writer of MP4 files, and the film of an episode that is made with it."""

from __future__ import annotations

import os
from collections.abc import Sequence
from fractions import Fraction
from pathlib import Path
from types import TracebackType
from typing import Any

import av
import numpy as np
from PIL import Image as Picture

from caldrive.datatypes import Image, Step
from caldrive.files import temporary_path
from caldrive.interfaces import World, is_mapped, is_recordable
from caldrive.results import EpisodeResult, Infraction
from caldrive.scenarios import Scenario
from caldrive.visualization.hud import CAMERA, PANEL, Hud, with_outcome
from caldrive.visualization.minimap import MiniMap
from caldrive.world.scene.weather import weather

FALLBACK_CODEC = "mpeg4"  # for builds of FFmpeg without x264
LAST_FRAMES = 15  # that the outcome stays on the screen
# mbtree: with AVX-512, x264's macroblock tree reads memory that it never wrote, and the same frames give other bytes in
# every fourth process. Without it, crf 24 gives the quality and size that 22 gives with it.
X264 = {"preset": "veryfast", "crf": "24", "x264-params": "mbtree=0"}


class VideoWriter:
    """Frames (H, W, 3) of one even size in, one MP4 out, in H.264, which every browser plays. rate: frames a second.

    Use it in a `with` block: the file appears whole at the block's end, and not at all after an error or without a
    frame.
    """

    def __init__(self, path: Path, rate: float = 10.0) -> None:
        self.path, self.rate, self.frames = path, rate, 0
        self._temporary = temporary_path(path)
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
            self._stream.options = X264
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


def caption(scenario: Scenario, number: int, of: int) -> str:
    """One line that says where and under which conditions the car drives."""
    conditions = weather(scenario.weather)
    town = Path(scenario.town).name
    count = f"   episode {number} of {of}" if of > 1 else ""
    return f"{town}   {scenario.task}   weather {conditions.id} {conditions.name}{count}"


class EpisodeFilm:
    """Films one episode in a world. Where the world has no map, there is no minimap; where its cameras cannot be moved,
    the agent's own image is shown.

    caption: the line above the picture. infractions: those that the referee has counted so far, a list that grows.
    truth: whether the true affordances stand beside those that the agent goes by.
    """

    def __init__(
        self, video: VideoWriter, world: World, scenario: Scenario, *, caption: str, infractions: Sequence[Infraction],
        truth: bool,
    ) -> None:  # fmt: skip
        self.video, self.world, self.scenario = video, world, scenario
        self.caption, self.infractions, self.truth = caption, infractions, truth
        self._hud: Hud | None = None  # drawn for a route, which is known after the world's reset
        self._last: Image | None = None

    def add(self, step: Step) -> None:
        """Film the world as it stands at a step."""
        if self._hud is None:
            self._hud = Hud(self.caption, self.scenario.time_limit, self._minimap(), self.truth)
        self._last = self._hud.draw(self._view(step), step, self.infractions)
        self.video.add(self._last)

    def _minimap(self) -> MiniMap | None:
        if not is_mapped(self.world):
            return None
        return MiniMap(self.world.roads, self.world.route, self.scenario.goal, PANEL)

    def _view(self, step: Step) -> Image:
        """The picture (432, 960, 3)."""
        if is_recordable(self.world):
            return self.world.images([CAMERA])[0]
        image = Picture.fromarray(step.observation.image).resize((CAMERA.width, CAMERA.height))
        return np.asarray(image.convert("RGB"))

    def end(self, result: EpisodeResult) -> None:
        """Hold the last frame, with the outcome across it."""
        if self._last is not None:
            self.video.add(with_outcome(self._last, result), times=LAST_FRAMES)
