"""The frames of a video that shows what the network sees in a person's own pictures: no map, no speed, no truth."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from PIL import Image as Picture
from PIL import ImageDraw

from caldrive.datatypes import Affordances, Command, Image
from caldrive.visualization.gauges import BACKGROUND, MUTED, RED, TOP, Draw, draw_frame, draw_gauges, write
from caldrive.visualization.hud import CAMERA, HEADER, PANEL, draw_badge, draw_command

WIDTH = CAMERA.width
LOWEST, HIGHEST = 216, 720  # pixels: the height that a picture is given, whatever its shape
NUMBERS = 140  # pixels from the left to what is said of the picture
NETWORK_VIEW = (684, TOP, WIDTH - 16, PANEL - 16)  # left, top, right, bottom in the panel: the network's image
NO_USE = "NO USE"


@dataclass(frozen=True)
class SeenPicture:
    """A picture (H, W, 3) and what the network made of it.

    label: which one it is; time in s; rows: the first row that the network looked at and the one after the last;
    network_image (h, w, 3): what it was given; affordances: None where the picture tells nothing; note: why.
    """

    label: str
    time: float
    picture: Image
    rows: tuple[int, int]
    network_image: Image
    affordances: Affordances | None
    note: str = ""


class SeenFrames:
    """Draws frames of one size, whatever the sizes of the pictures; the first one decides it. caption: the line above
    the picture; command: the one that the network was given."""

    def __init__(self, caption: str, command: Command) -> None:
        self.caption, self.command = caption, command
        self._height: int | None = None

    def draw(self, seen: SeenPicture) -> Image:
        """A frame (H, 960, 3); H is even, and stays the same."""
        if self._height is None:
            height, width = seen.picture.shape[:2]
            self._height = min(max(round(WIDTH * height / width / 2) * 2, LOWEST), HIGHEST)
        header = Picture.new("RGB", (WIDTH, HEADER), BACKGROUND)
        write(ImageDraw.Draw(header), (16, HEADER / 2), self.caption, 17)
        return np.concatenate((np.asarray(header), self._view(seen, self._height), self._panel(seen)))

    def _view(self, seen: SeenPicture, height: int) -> Image:
        """The whole picture, darker where the network does not look."""
        dimmed = seen.picture // 3
        dimmed[slice(*seen.rows)] = seen.picture[slice(*seen.rows)]
        view = Picture.new("RGB", (WIDTH, height), BACKGROUND)
        _paste_within(view, dimmed, (0, 0, WIDTH, height))
        if seen.affordances is None:
            draw_badge(ImageDraw.Draw(view), (16, 12), NO_USE, RED, seen.note)
        return np.asarray(view)

    def _panel(self, seen: SeenPicture) -> Image:
        panel = Picture.new("RGB", (WIDTH, PANEL), BACKGROUND)
        draw = ImageDraw.Draw(panel)
        draw_command(panel, draw, self.command)
        self._write_numbers(draw, seen)
        draw_frame(draw, truth=False)
        draw_gauges(draw, seen.affordances, None)
        write(draw, (NETWORK_VIEW[0], TOP - 12), "what the network is given", 13, MUTED)
        _paste_within(panel, seen.network_image, NETWORK_VIEW)
        return np.asarray(panel)

    def _write_numbers(self, draw: Draw, seen: SeenPicture) -> None:
        height, width = seen.picture.shape[:2]
        lines = {"picture": seen.label, "time": f"{seen.time:.2f} s", "size": f"{width} x {height}"}
        if seen.rows != (0, height):
            lines["rows"] = f"{seen.rows[0]} to {seen.rows[1]}"
        for row, (name, value) in enumerate(lines.items()):
            write(draw, (NUMBERS, 24 + 46 * row), name, 13, MUTED)
            write(draw, (NUMBERS, 43 + 46 * row), value, 16)


def _paste_within(canvas: Picture.Image, image: Image, box: tuple[int, int, int, int]) -> None:
    """Paste an image as large as it fits into a box, in its middle from left to right."""
    width, height = box[2] - box[0], box[3] - box[1]
    scale = min(width / image.shape[1], height / image.shape[0])
    size = max(1, round(image.shape[1] * scale)), max(1, round(image.shape[0] * scale))
    fitted = Picture.fromarray(image).resize(size, Picture.Resampling.BILINEAR)
    canvas.paste(fitted, (box[0] + (width - size[0]) // 2, box[1]))
