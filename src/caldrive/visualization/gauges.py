"""The affordances as gauges, and the letters and bars of which these and the rest of the head-up display are made.

What an affordance is (its name, range and unit) stands in `affordances.SPECS`; here is only how each is drawn.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache

from PIL import ImageDraw, ImageFont

from caldrive.affordances import SPECS, AffordanceSpec
from caldrive.datatypes import Affordances

Color = tuple[int, int, int]
Draw = ImageDraw.ImageDraw
Box = tuple[float, float, float, float]  # left, top, right, bottom in pixels

BACKGROUND, TRACK = (18, 20, 24), (48, 53, 61)
TEXT, MUTED, DARK_TEXT = (238, 240, 243), (150, 157, 167), (20, 20, 20)
BLUE, GREEN, RED, AMBER = (72, 145, 245), (52, 190, 105), (232, 72, 62), (245, 170, 50)

LEFT, TOP, HEIGHT = 322, 46, 174  # pixels: where the gauges begin, and the height of all of them
ROW = HEIGHT / len(SPECS)
BAR_LEFT, BAR_RIGHT, VALUE, TRUE = LEFT + 130, LEFT + 258, LEFT + 330, LEFT + 392
NOT_GIVEN, NO_NUMBER = "-", "?"  # the letters of Pillow have no longer dash


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


@dataclass(frozen=True)
class Gauge:
    """How an affordance is drawn. reach: the value at the end of its bar, where that is not the end of its range."""

    color: Color = BLUE
    reach: float | None = None


GAUGES: Mapping[str, Gauge] = {  # by the affordance's name; another one is drawn as Gauge() says
    "hazard_stop": Gauge(RED),
    "red_light": Gauge(RED),
    "vehicle_distance": Gauge(AMBER),
    "relative_angle": Gauge(BLUE, reach=math.radians(60)),
    "center_distance": Gauge(BLUE),
}


def _gauge(spec: AffordanceSpec) -> Gauge:
    return GAUGES.get(spec.name, Gauge())


def _value(spec: AffordanceSpec, affordances: Affordances | None) -> float | None:
    """An affordance as a number, 0 for none; None where there are no affordances."""
    return None if affordances is None else float(getattr(affordances, spec.name) or 0.0)


def _share(spec: AffordanceSpec, value: float) -> float:
    """Where on its bar a value lies, from 0 to 1. What lies to the left of the car lies to the left on the bar."""
    high = _gauge(spec).reach or spec.high
    if spec.low < 0:
        return 0.5 - value / high / 2
    return (value - spec.low) / (high - spec.low)


def value_text(spec: AffordanceSpec, value: float | None) -> str:
    """A value as people read it: percent, metres, degrees, or the number on a sign."""
    if value is None:
        return NOT_GIVEN
    if not math.isfinite(value):
        return NO_NUMBER
    if spec.binary:
        return f"{100 * value:.0f} %"
    if spec.discrete:
        return f"{value:.0f}" if value else "none"
    if spec.unit == "rad":
        return f"{math.degrees(value):+.1f}°"
    return f"{value:+.2f} {spec.unit}" if spec.low < 0 else f"{value:.1f} {spec.unit}"


def _middle(row: int) -> float:
    """The height at which the gauge of a row lies."""
    return TOP + ROW * (row + 0.5)


def _bar(row: int) -> Box:
    return BAR_LEFT, _middle(row) - 5, BAR_RIGHT, _middle(row) + 5


def _has_bar(spec: AffordanceSpec) -> bool:
    """A bar shows a share; one of several classes has a box for each."""
    return spec.binary or not spec.discrete


def draw_frame(draw: Draw, truth: bool) -> None:
    """What never changes: names and empty bars. truth: whether there is a column for the true values."""
    write(draw, (VALUE, TOP - 12), "seen" if truth else "value", 13, MUTED, "rm")
    if truth:
        write(draw, (TRUE, TOP - 12), "true", 13, MUTED, "rm")
    write(draw, (LEFT, TOP - 12), "affordances", 13, MUTED)
    for row, spec in enumerate(SPECS):
        write(draw, (LEFT, _middle(row)), spec.title, 15)
        if _has_bar(spec):
            track(draw, _bar(row))


def draw_gauges(draw: Draw, seen: Affordances | None, true: Affordances | None) -> None:
    """The values, over a frame by `draw_frame`. seen: None where the agent gives none; true: None leaves it out."""
    for row, spec in enumerate(SPECS):
        value, real = _value(spec, seen), _value(spec, true)
        write(draw, (VALUE, _middle(row)), value_text(spec, value), 16, MUTED if value is None else TEXT, "rm")
        if real is not None:
            write(draw, (TRUE, _middle(row)), value_text(spec, real), 13, MUTED, "rm")
        draw_value = _fill_bar if _has_bar(spec) else _draw_classes
        draw_value(draw, _bar(row), spec, value, real)


def _fill_bar(draw: Draw, bar: Box, spec: AffordanceSpec, value: float | None, real: float | None) -> None:
    """A bar from where the affordance says nothing (nobody ahead, no angle) to its value, and a mark at the truth."""
    if value is not None and math.isfinite(value):
        rest = _value(spec, Affordances()) or 0.0
        fill(draw, bar, _share(spec, rest), _share(spec, value), _gauge(spec).color)
    if real is not None:
        tick(draw, bar, _share(spec, real))


def _draw_classes(draw: Draw, bar: Box, spec: AffordanceSpec, value: float | None, real: float | None) -> None:
    """A box for each class but the first, which stands for none; the one that is seen is lit."""
    left, top, right, bottom = bar
    classes, gap = spec.classes[1:], 4
    width = (right - left + gap) / len(classes)
    for k, number in enumerate(classes):
        box = (left + k * width, top - 4, left + (k + 1) * width - gap, bottom + 4)
        lit = value == number
        outline = RED if number in (value, real) else None
        draw.rounded_rectangle(box, 4, fill=TEXT if lit else TRACK, outline=outline, width=2)
        write(draw, ((box[0] + box[2]) / 2, (top + bottom) / 2), str(number), 13, DARK_TEXT if lit else MUTED, "mm")
