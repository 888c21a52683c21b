"""Attention drawn over an image as in the paper: the colour says how likely the class is, from green to red, the
opacity how much attention a place gets; what gets none stays as it is.

What makes a value larger is orange, what makes it smaller blue. One scale holds for a whole drive: with a scale of its
own for each image, noise would look like attention wherever there is nothing to see.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from PIL import Image as Picture
from PIL import ImageDraw

from caldrive.datatypes import Image
from caldrive.explain.activation_maps import Attention, Map, Reply, upsampled
from caldrive.visualization.gauges import BACKGROUND, MUTED, Draw, write

GREEN, YELLOW, RED = (46, 160, 67), (250, 204, 21), (220, 38, 38)
LARGER, SMALLER = (249, 115, 22), (37, 99, 235)
STRONGEST = 0.75  # opacity of the scale's end
FAINT = 0.08  # share of the scale below which a place stays transparent
SCALE_PERCENTILE = 99.0  # of all places of a drive's maps
BAR = 26  # pixels of height below an image, for how far back the block looks


def scale_of(maps: Sequence[Map]) -> float:
    """The attention that is drawn as strongest: nearly the most of all maps together."""
    values = np.concatenate([np.abs(one).ravel() for one in maps]) if maps else np.zeros(1)
    return max(float(np.percentile(values, SCALE_PERCENTILE)), 1e-12)


def likely_color(probability: float) -> tuple[int, int, int]:
    """From green over yellow to red."""
    low, high, share = (GREEN, YELLOW, 2 * probability) if probability < 0.5 else (YELLOW, RED, 2 * probability - 1)
    red, green, blue = (round(a + (b - a) * share) for a, b in zip(low, high, strict=True))
    return red, green, blue


def overlay(image: Image, one: Map, scale: float, probability: float | None) -> Image:
    """A map over an image (H, W, 3) of any size. scale: as of `scale_of`; probability: of the class, None where the map
    is signed."""
    strength = np.clip(upsampled(one, image.shape[:2]) / scale, -1, 1)
    opacity = STRONGEST * np.clip((np.abs(strength) - FAINT) / (1 - FAINT), 0, 1)[..., None]
    if probability is not None:
        color = np.broadcast_to(np.array(likely_color(probability), float), image.shape)
    else:
        color = np.where(strength[..., None] > 0, np.array(LARGER, float), np.array(SMALLER, float))
    mixed: NDArray[np.float64] = image * (1 - opacity) + color * opacity
    return mixed.round().astype(np.uint8)


def explained(image: Image, attention: Attention, scale: float, *, width: int = 640) -> Image:
    """An image with the attention over it, so many pixels wide, and below it what is asked and how far back the block
    looks."""
    height = round(image.shape[0] * width / image.shape[1])
    large = np.asarray(Picture.fromarray(image).resize((width, height), Picture.Resampling.BICUBIC))
    picture = Picture.new("RGB", (width, height + BAR), BACKGROUND)
    picture.paste(Picture.fromarray(overlay(large, attention.now, scale, attention.reply.probability)))
    draw = ImageDraw.Draw(picture)
    write(draw, (8, height + BAR / 2), said(attention.reply), 14)
    if len(attention.maps) > 1:
        _draw_bar(draw, attention, (width - 208, height + 5, width - 8, height + BAR - 5))
    return np.asarray(picture)


def said(reply: Reply) -> str:
    """What is asked, and what the network says."""
    if reply.probability is not None:
        return f"{reply.label}: {100 * reply.probability:.0f} %"
    return f"{reply.label}: {reply.value:.2f}"


def _draw_bar(draw: Draw, attention: Attention, box: tuple[int, int, int, int]) -> None:
    """The share of the attention that each frame of the history has, the present one at the right."""
    left, top, right, bottom = box
    cell = (right - left) / len(attention.shares)
    largest = max(attention.shares)
    for k, share in enumerate(attention.shares):
        x = left + k * cell
        draw.rectangle((x + 1, top, x + cell - 1, bottom), outline=MUTED)
        level = bottom - (bottom - top) * share / max(largest, 1e-12)
        draw.rectangle((x + 1, level, x + cell - 1, bottom), fill=MUTED)
