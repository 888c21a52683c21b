"""Shadows of buildings and trees, as heights: a point is in the shade where it lies lower than the shadow above it.

That is a picture of the town from above whose value is a height, so one look-up shades road, façades, cars and people.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFilter

from caldrive.geometry import box_corners
from caldrive.world.scene.scenery import Prop

RESOLUTION = 0.25  # m of one pixel
MARGIN = 30.0  # m around the roads
LARGEST, STEP = 1000.0, 500.0  # m along a side: of larger towns the part around a place is drawn, in steps
TALLEST_SHADOW = 32.0  # m, the value of a full pixel
Heights = NDArray[np.uint8]  # (rows, columns), row 0 at the lowest y, in units of TALLEST_SHADOW / 255
Bounds = tuple[float, float, float, float]  # x_min, y_min, x_max, y_max in m


def _units(height: float) -> int:
    return round(min(height / TALLEST_SHADOW, 1.0) * 255)


def _drawn(props: Sequence[Prop], bounds: Bounds, kind: str) -> Heights:
    """Heights of the tops of all props of a kind, seen from above."""
    x0, y0, x1, y1 = bounds
    size = (round((x1 - x0) / RESOLUTION), round((y1 - y0) / RESOLUTION))
    picture = Image.new("L", size, 0)
    draw = ImageDraw.Draw(picture)
    for prop in sorted((prop for prop in props if prop.kind == kind), key=lambda prop: prop.height):
        if kind == "tree":
            x, y = (prop.pose.x - x0) / RESOLUTION, (prop.pose.y - y0) / RESOLUTION
            radius = 0.2 * prop.height / RESOLUTION
            draw.ellipse((x - radius, y - radius, x + radius, y + radius), fill=_units(0.8 * prop.height))
        else:
            corners = (box_corners(prop.pose, prop.length, prop.width) - (x0, y0)) / RESOLUTION
            draw.polygon([(u, v) for u, v in corners.tolist()], fill=_units(prop.height))
    return np.asarray(picture)


def _shifted(heights: Heights, columns: int, rows: int) -> Heights:
    """The picture seen from a pixel that lies (columns, rows) away, 0 beyond the edges."""
    shifted = np.zeros_like(heights)
    h, w = heights.shape
    to_x, from_x = slice(max(0, -columns), min(w, w - columns)), slice(max(0, columns), min(w, w + columns))
    to_y, from_y = slice(max(0, -rows), min(h, h - rows)), slice(max(0, rows), min(h, h + rows))
    if abs(columns) < w and abs(rows) < h:
        shifted[to_y, to_x] = heights[from_y, from_x]
    return shifted


def cast_shadows(heights: Heights, sun: NDArray[np.float64]) -> Heights:
    """Heights below which the air is in shade, from the heights of what stands there and the direction (3,) to the sun.

    Each pixel takes over its neighbour's height towards the sun, less the fall; the neighbours' distance doubles.
    """
    flat = float(np.hypot(sun[0], sun[1]))
    fall, shade = float(sun[2]) / flat * 255 / TALLEST_SHADOW, heights.copy()
    reach, step = float(heights.max()) / fall, RESOLUTION
    while step < reach:
        columns, rows = (round(step * float(s) / flat / RESOLUTION) for s in sun[:2])
        lower = np.uint8(min(255, round(step * fall)))
        np.maximum(shade, np.maximum(_shifted(shade, columns, rows), lower) - lower, out=shade)
        step *= 2
    return shade


def shadow_bounds(roads_bounds: Bounds, x: float, y: float) -> Bounds:
    """The rectangle that the shadow picture of a town covers where somebody looks at it from (x, y), from that of its
    roads."""
    x0, y0, x1, y1 = np.add(roads_bounds, (-MARGIN, -MARGIN, MARGIN, MARGIN)).tolist()
    if max(x1 - x0, y1 - y0) <= LARGEST:
        return x0, y0, x1, y1
    u, v = round(x / STEP) * STEP, round(y / STEP) * STEP
    return u - LARGEST / 2, v - LARGEST / 2, u + LARGEST / 2, v + LARGEST / 2


def _softened(heights: Heights) -> Heights:
    """Rounds off the steps that pixels leave along slanting edges."""
    soft = np.array(Image.fromarray(heights).filter(ImageFilter.BoxBlur(2)))
    soft[[0, -1]] = soft[:, [0, -1]] = 0  # the edge stands for everything beyond
    return soft


def shadow_heights(props: Sequence[Prop], bounds: Bounds, sun: NDArray[np.float64]) -> NDArray[np.uint8]:
    """Shadow heights (rows, columns, 2): of buildings with trees, and of buildings alone. sun: direction (3,) to it."""
    houses = cast_shadows(_drawn(props, bounds, "building"), sun)
    trees = cast_shadows(_drawn(props, bounds, "tree"), sun)
    return np.stack((_softened(np.maximum(houses, trees)), _softened(houses)), axis=-1)
