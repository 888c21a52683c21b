"""A camera that fails: what it shows then. The camera check learns from it, and any agent may be tried on it.

A fault takes the true image (H, W, 3) in bytes and the seconds since it began, and gives what the camera shows instead.
How strong it is, and where, comes from its seed and stays.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from caldrive.datatypes import Image

Fault = Callable[[Image, float], Image]
Picture = NDArray[np.floating[Any]]
Law = Callable[[Picture, float, np.random.Generator, np.random.Generator], Picture]  # image, seconds, fixed, changing

DYING = 30.0  # s that a slow fault takes


def _one_colour(image: Picture, colour: float | Picture) -> Picture:
    return np.zeros_like(image) + np.asarray(colour, np.float32)


def _speckled(image: Picture, share: float, rng: np.random.Generator) -> Picture:
    """That share of the pixels black or white."""
    wrong = rng.random(image.shape[:2]) < share
    image[wrong] = 255 * rng.integers(0, 2, (np.count_nonzero(wrong), 1))
    return image


def _tinted(image: Picture, fixed: np.random.Generator) -> Picture:
    """One colour channel, or two, less than half as bright."""
    weak = fixed.permutation(3)[: fixed.integers(1, 3)]
    image[..., weak] *= fixed.uniform(0.0, 0.45)
    return image


def _blurred(image: Picture, reach: int) -> Picture:
    """Each pixel the mean of those around it, up to so many away."""
    for axis in (0, 1):
        sums = np.cumsum(np.repeat(image, _repeats(image.shape[axis], reach), axis), axis, dtype=np.float64)
        n = image.shape[axis]
        ahead, behind = sums.take(range(2 * reach + 1, 2 * reach + 1 + n), axis), sums.take(range(n), axis)
        image = ((ahead - behind) / (2 * reach + 1)).astype(np.float32)
    return image


def _repeats(n: int, reach: int) -> NDArray[np.int64]:
    """How often each row counts where the edges stand on."""
    repeats = np.ones(n, np.int64)
    repeats[0] += reach + 1
    repeats[-1] += reach
    return repeats


def _part(image: Picture, fixed: np.random.Generator) -> Picture:
    """A side or the lower part in one colour, which may be a little transparent."""
    height, width = image.shape[:2]
    share, colour = fixed.uniform(0.35, 0.6), fixed.uniform(0, 255)
    rows, columns = slice(None), slice(None)
    match fixed.integers(0, 3):
        case 0:
            columns = slice(round(share * width))
        case 1:
            columns = slice(round((1 - share) * width), None)
        case _:
            rows = slice(round((1 - share) * height), None)
    image[rows, columns] = colour
    return image


def _dirt(image: Picture, fixed: np.random.Generator) -> Picture:
    """A round thing with soft edges on the lens, where the road and the cars on it are."""
    rows, columns = np.indices(image.shape[:2])
    height, width = image.shape[:2]
    x, y = fixed.uniform(0.25, 0.75), fixed.uniform(0.45, 0.75)
    away = np.hypot((columns / width - x) * width / height, rows / height - y) / fixed.uniform(0.2, 0.4)
    hidden = (np.clip(4 * (1 - away), 0, 1) * fixed.uniform(0.85, 1.0))[..., None].astype(np.float32)
    colour = fixed.uniform(0, 200, 3).astype(np.float32)
    return np.asarray(image * (1 - hidden) + hidden * colour)


def _moved(image: Picture, fixed: np.random.Generator) -> Picture:
    """The camera looks up or down, and the rest is black."""
    rows = round(fixed.uniform(0.2, 0.5) * len(image)) * int(fixed.choice((-1, 1)))
    image = np.roll(image, rows, axis=0)
    image[slice(0, rows) if rows > 0 else slice(rows, None)] = 0
    return image


LAWS: dict[str, Law] = {
    "black": lambda image, _, __, ___: _one_colour(image, 0),
    "white": lambda image, _, __, ___: _one_colour(image, 255),
    "grey": lambda image, _, fixed, __: _one_colour(image, fixed.uniform(60, 200)),
    "green": lambda image, _, __, ___: _one_colour(image, np.array((0, 135, 0), np.float32)),
    "noise": lambda image, _, __, rng: rng.uniform(0, 255, image.shape).astype(np.float32),
    "grain": lambda image, _, fixed, rng: image + rng.normal(0, fixed.uniform(20, 70), image.shape),
    "speckles": lambda image, _, fixed, rng: _speckled(image, fixed.uniform(0.12, 0.3), rng),
    "growing grain": lambda image, seconds, __, rng: image + rng.normal(0, 4 * seconds, image.shape),
    "mirrored": lambda image, _, __, ___: image[:, ::-1],
    "upside down": lambda image, _, __, ___: image[::-1],
    "turned": lambda image, _, __, ___: image[::-1, ::-1],
    "moved": lambda image, _, fixed, __: _moved(image, fixed),
    "red and blue exchanged": lambda image, _, __, ___: image[..., ::-1],
    "tinted": lambda image, _, fixed, __: _tinted(image, fixed),
    "no colour": lambda image, _, __, ___: _one_colour(image, image.mean(axis=2, keepdims=True)),
    "overexposed": lambda image, _, fixed, __: image * fixed.uniform(2.5, 4),
    "dark": lambda image, _, fixed, __: image * fixed.uniform(0.08, 0.25),
    "dying": lambda image, seconds, __, ___: image * max(0.0, 1 - seconds / DYING),
    "fading": lambda image, seconds, __, ___: 128 + (image - 128) * max(0.0, 1 - seconds / DYING),
    "blurred": lambda image, _, fixed, __: _blurred(image, int(fixed.integers(4, 9))),
    "half covered": lambda image, _, fixed, __: _part(image, fixed),
    "dirt on the lens": lambda image, _, fixed, __: _dirt(image, fixed),
}  # fmt: skip
FROZEN, TREMBLING, TORN = "frozen", "frozen with grain", "lower half frozen"
FAULTS = (*LAWS, FROZEN, TREMBLING, TORN)


def make_fault(name: str, seed: int = 0) -> Fault:
    """A fault by name, which begins with its first image. Raises ValueError for an unknown one."""
    if name not in FAULTS:
        raise ValueError(f"found the camera fault {name!r}, wanted one of {', '.join(FAULTS)}")
    changing = np.random.default_rng((seed, 1))
    kept: list[Image] = []

    def show(image: Image, seconds: float) -> Image:
        if name in LAWS:
            return _as_bytes(LAWS[name](image.astype(np.float32), seconds, np.random.default_rng(seed), changing))
        kept[1:] = [image]
        shown = kept[0].astype(np.float32)
        if name == TREMBLING:
            shown += changing.normal(0, 3, image.shape)
        if name == TORN:
            shown[: len(image) // 2] = image[: len(image) // 2]
        return _as_bytes(shown)

    return show


def _as_bytes(image: Picture) -> Image:
    return np.ascontiguousarray(np.clip(np.rint(image), 0, 255).astype(np.uint8))
