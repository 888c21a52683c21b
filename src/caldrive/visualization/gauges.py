"""Colours, letters and bars for pictures: the few strokes of which the head-up display is made."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

from PIL import ImageDraw, ImageFont

from caldrive.datatypes import MAX_CENTER_DISTANCE, MAX_VEHICLE_DISTANCE, SPEED_SIGNS, Affordances

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


LEFT, TOP, ROW = 322, 46, 29  # pixels: where the gauges begin, and the height of each
BAR_LEFT, BAR_RIGHT, VALUE, TRUE = LEFT + 130, LEFT + 258, LEFT + 330, LEFT + 392
WIDEST_ANGLE = math.radians(60)


@dataclass(frozen=True)
class Gauge:
    """label: how it is called; share: where on the bar a value lies; rest: the bar's share of a value of nothing."""

    name: str
    label: str
    share: Callable[[float], float]
    text: Callable[[float], str]
    color: Color
    rest: float = 0.0


def _percent(value: float) -> str:
    return f"{100 * value:.0f} %"


GAUGES = (
    Gauge("hazard_stop", "hazard stop", lambda p: p, _percent, RED),
    Gauge("red_light", "red light", lambda p: p, _percent, RED),
    Gauge("speed_sign", "speed sign", lambda v: v, lambda v: f"{v:.0f}" if v else "none", TEXT),
    Gauge("vehicle_distance", "vehicle ahead", lambda d: d / MAX_VEHICLE_DISTANCE, lambda d: f"{d:.1f} m", AMBER, 1.0),
    # The bars of what lies to the left grow to the left.
    Gauge("relative_angle", "relative angle", lambda a: 0.5 - a / WIDEST_ANGLE / 2,
          lambda a: f"{math.degrees(a):+.1f}°", BLUE, 0.5),
    Gauge("center_distance", "centre distance", lambda d: 0.5 - d / MAX_CENTER_DISTANCE / 2,
          lambda d: f"{d:+.2f} m", BLUE, 0.5),
)  # fmt: skip


def _box(row: int) -> Box:
    middle = TOP + ROW * (row + 0.5)
    return BAR_LEFT, middle - 5, BAR_RIGHT, middle + 5


def _sign_box(row: int, i: int) -> Box:
    box, width = _box(row), (BAR_RIGHT - BAR_LEFT - 8) / 3
    left = box[0] + i * (width + 4)
    return left, box[1] - 4, left + width, box[3] + 4


def draw_frame(draw: Draw, truth: bool) -> None:
    """What never changes: names and empty bars."""
    write(draw, (VALUE, TOP - 12), "seen" if truth else "value", 13, MUTED, "rm")
    if truth:
        write(draw, (TRUE, TOP - 12), "true", 13, MUTED, "rm")
    write(draw, (LEFT, TOP - 12), "affordances", 13, MUTED)
    for row, gauge in enumerate(GAUGES):
        write(draw, (LEFT, TOP + ROW * (row + 0.5)), gauge.label, 15)
        if gauge.name != "speed_sign":
            track(draw, _box(row))


def draw_gauges(draw: Draw, seen: Affordances, true: Affordances | None) -> None:
    """All six values; true: None leaves the truth out."""
    for row, gauge in enumerate(GAUGES):
        value = float(getattr(seen, gauge.name) or 0.0)
        real = None if true is None else float(getattr(true, gauge.name) or 0.0)
        middle = TOP + ROW * (row + 0.5)
        write(draw, (VALUE, middle), gauge.text(value) if math.isfinite(value) else "?", 16, TEXT, "rm")
        if real is not None:
            write(draw, (TRUE, middle), gauge.text(real), 13, MUTED, "rm")
        if gauge.name == "speed_sign":
            _draw_signs(draw, row, value, real)
        elif math.isfinite(value):
            fill(draw, _box(row), gauge.rest, gauge.share(value), gauge.color)
            if real is not None:
                tick(draw, _box(row), gauge.share(real))


def _draw_signs(draw: Draw, row: int, value: float, real: float | None) -> None:
    for i, sign in enumerate(SPEED_SIGNS):
        box, lit = _sign_box(row, i), value == sign
        draw.rounded_rectangle(
            box, 4, fill=TEXT if lit else TRACK, outline=RED if lit or real == sign else None, width=2
        )
        middle = ((box[0] + box[2]) / 2, (box[1] + box[3]) / 2)
        write(draw, middle, str(sign), 13, (20, 20, 20) if lit else MUTED, "mm")
