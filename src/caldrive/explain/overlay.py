"""Attention drawn over an image as in the paper: the colour says how likely the class is, from green to red, the
opacity how much attention a place gets; what gets none stays as it is.

What makes a value larger is orange, what makes it smaller blue. One scale holds for a whole drive: with a scale of its
own for each image, noise would look like attention wherever there is nothing to see. A still has a strip below it with
all frames that the block looks at, on one scale.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from PIL import Image as Picture
from PIL import ImageDraw

from caldrive.affordances import AffordanceSpec
from caldrive.datatypes import Image
from caldrive.explain.activation_maps import Attention, Map, Reply, frames_at, upsampled
from caldrive.visualization.gauges import BACKGROUND, MUTED, Draw, write

GREEN, YELLOW, RED = (46, 160, 67), (250, 204, 21), (220, 38, 38)
LARGER, SMALLER = (249, 115, 22), (37, 99, 235)
STRONGEST = 0.75  # opacity of the scale's end
FAINT = 0.08  # share of the scale below which a place stays transparent
SCALE_PERCENTILE = 99.0  # of all places of a drive's maps
BAR = 26  # pixels of height below an image, for how far back the block looks
LABEL = 14  # and for what a frame of a strip is called


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


def explained(image: Image, attention: Attention, scale: float, *, width: int = 640, truth: str = "") -> Image:
    """An image with the attention over it, so many pixels wide, and below it what is asked and how far back the block
    looks. truth: by `true_text`, where it is known."""
    picture, draw, top = _page(image, attention, scale, width, BAR, truth)
    if len(attention.maps) > 1:
        _draw_bar(draw, attention, (width - 208, top + 5, width - 8, top + BAR - 5))
    return np.asarray(picture)


def still(images: Sequence[Image], attention: Attention, scale: float, *, width: int = 640, truth: str = "") -> Image:
    """The same of the newest of some images, with a strip of all frames that the block looks at, the oldest first: each
    with its attention, and below it its share of all attention and how far back it lies."""
    frames = frames_at(images, attention.back)
    if len(frames) == 1:
        return explained(images[-1], attention, scale, width=width, truth=truth)
    cell = width // len(frames)
    height = round(images[-1].shape[0] * cell / images[-1].shape[1])
    picture, draw, top = _page(images[-1], attention, scale, width, BAR + height + BAR + LABEL, truth)
    for k, (frame, one) in enumerate(zip(frames, attention.maps, strict=True)):
        small = overlay(_resized(frame, (cell, height)), one, scale, attention.reply.probability)
        picture.paste(Picture.fromarray(small), (k * cell, top + BAR))
        back = f"{attention.back[k]} frames back" if attention.back[k] else "now"
        write(draw, ((k + 0.5) * cell, top + height + 2 * BAR + LABEL / 2), back, 10, MUTED, "mm")
    _draw_bar(draw, attention, (0, top + BAR + height + 3, cell * len(frames), top + height + 2 * BAR - 2))
    return np.asarray(picture)


def _page(
    image: Image, attention: Attention, scale: float, width: int, below: int, truth: str
) -> tuple[Picture.Image, Draw, int]:
    """An image with the attention over it and so many pixels below it, which begin with what is asked; its pen, and
    where they begin."""
    height = round(image.shape[0] * width / image.shape[1])
    picture = Picture.new("RGB", (width, height + below), BACKGROUND)
    large = overlay(_resized(image, (width, height)), attention.now, scale, attention.reply.probability)
    picture.paste(Picture.fromarray(large))
    draw = ImageDraw.Draw(picture)
    write(draw, (8, height + BAR / 2), said(attention.reply, truth), 14)
    return picture, draw, height


def _resized(image: Image, size: tuple[int, int]) -> Image:
    """An image at the size (width, height)."""
    return np.asarray(Picture.fromarray(image).resize(size, Picture.Resampling.BICUBIC))


def said(reply: Reply, truth: str = "") -> str:
    """What is asked, and what the network says; truth: by `true_text`, where it is known."""
    answer = f"{reply.value:.2f}" if reply.probability is None else f"{100 * reply.probability:.0f} %"
    return f"{reply.label}: {answer}, true: {truth}" if truth else f"{reply.label}: {answer}"


def true_text(spec: AffordanceSpec, value: float | None) -> str:
    """An affordance's true value: yes or no, a class, or a number in SI units; None stands for no sign."""
    if spec.binary:
        return "yes" if value else "no"
    if spec.discrete:
        return f"{value:.0f}" if value else "none"
    return f"{value:.2f}"


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
