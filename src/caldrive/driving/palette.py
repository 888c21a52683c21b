"""Colours, letters and bars for pictures: the few strokes of which the head-up display is made."""

from __future__ import annotations

from functools import lru_cache

from PIL import ImageDraw, ImageFont

Color = tuple[int, int, int]
Draw = ImageDraw.ImageDraw
Box = tuple[float, float, float, float]  # left, top, right, bottom in pixels

BACKGROUND, TRACK = (18, 20, 24), (48, 53, 61)
TEXT, MUTED = (238, 240, 243), (150, 157, 167)
BLUE, GREEN, RED, AMBER = (72, 145, 245), (52, 190, 105), (232, 72, 62), (245, 170, 50)


@lru_cache(maxsize=16)
def font(size: int) -> ImageFont.FreeTypeFont | ImageFont.ImageFont:
    """Pillow's own letters, so that no font file is needed."""
    return ImageFont.load_default(size)


def write(draw: Draw, at: tuple[float, float], text: str, size: int, color: Color = TEXT, anchor: str = "lm") -> None:
    """One line of text; anchor as Pillow names it: l, m, r for left, middle, right, then m for the middle in height."""
    draw.text(at, text, fill=color, font=font(size), anchor=anchor)


def track(draw: Draw, box: Box) -> None:
    """An empty bar."""
    draw.rounded_rectangle(box, (box[3] - box[1]) / 2, fill=TRACK)


def fill(draw: Draw, box: Box, start: float, end: float, color: Color) -> None:
    """The part of a bar between two shares of its width, in any order."""
    left, right = sorted(box[0] + min(max(share, 0.0), 1.0) * (box[2] - box[0]) for share in (start, end))
    if right - left >= 1:
        draw.rounded_rectangle((left, box[1], right, box[3]), min(box[3] - box[1], right - left) / 2, fill=color)


def tick(draw: Draw, box: Box, share: float, color: Color = TEXT) -> None:
    """A mark across a bar."""
    x = box[0] + min(max(share, 0.0), 1.0) * (box[2] - box[0])
    draw.rectangle((x - 1, box[1] - 3, x + 1, box[3] + 3), fill=color)
