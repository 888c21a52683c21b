"""The watchdog: notices that the camera has failed, from what its images do while the car moves.

A frame that is no picture at all is refused by `images.check_image`. This finds what needs more than one look: a
picture that stands still while the car does not, a part of it that never changes, and images unlike the recording's.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from torch import Tensor

from caldrive.datatypes import Image, Observation
from caldrive.interfaces import BadImage
from caldrive.perception.network.camera_check import REASONS, WINDOWS, averaged, evidence

CELL = 8  # pixels a side of the cells in which images are compared


@dataclass(frozen=True)
class WatchdogConfig:
    """What is a fault. Below the horizon of a working camera something changes in every cell within 3 m, and in 0.4 of
    the cells within 1 m (seen in town01, 20 km/h)."""

    least_spread: float = 5.0
    """Standard deviation of a colour's bytes over an image, below which it is one plain colour."""
    oldest: float = 0.5
    """s that an image may be old."""
    change: float = 3.0
    """Bytes by which a cell's mean has to change to count as another picture; noise of one byte a pixel moves it by
    less."""
    frozen_metres: float = 1.0
    frozen_share: float = 0.9
    """The camera is frozen where at least this share of the cells below the horizon has not changed for so far."""
    still: float = 0.3
    """Bytes that a cell's pixels may change by, from one frame to the next, and still be the same."""
    covered_metres: float = 8.0
    covered_cells: int = 3
    """It is covered where at least so many cells below the horizon stay the same for so far."""
    release: float = 2.0
    """By how much the evidence has to fall below its threshold before images count again."""


class Watchdog:
    """Looks at every frame of an episode. thresholds: of the camera check, of the mean evidence for each of its
    reasons, above which the camera has failed."""

    def __init__(self, thresholds: Sequence[float] = (), config: WatchdogConfig | None = None) -> None:
        self.config = config or WatchdogConfig()
        self._thresholds = np.array(thresholds)
        self.reset()

    def reset(self) -> None:
        """An episode begins."""
        self._stillness = Stillness(self.config)
        self._evidence = np.zeros((max(WINDOWS), len(REASONS)), np.float32)  # of the last frames
        self._unlike = ""  # what is wrong, while the images are unlike the recording's

    def look(self, observation: Observation, outputs: Tensor | None = None) -> None:
        """Raises BadImage, with what is wrong, where the camera has failed. outputs: of the camera check (1, 1 +
        reasons), None without one."""
        faults = (  # each sees every frame, whatever the others say
            _old(observation, self.config.oldest),
            _plain(observation.image, self.config.least_spread),
            self._stillness.fault(observation),
            "" if outputs is None else self._unlike_recording(outputs),
        )
        if fault := next(filter(None, faults), ""):
            raise BadImage(f"{fault}: brake, and look at the camera")

    def _unlike_recording(self, outputs: Tensor) -> str:
        """What is wrong with the images of the last seconds, or nothing."""
        self._evidence = np.concatenate((self._evidence[1:], evidence(outputs).numpy()))
        above = averaged(self._evidence) - self._thresholds
        if above.max() > 0:
            self._unlike = f"the image is {tuple(REASONS)[above.argmax()]}"
        elif above.max() < -self.config.release:
            self._unlike = ""
        return self._unlike


class Stillness:
    """How far the car has moved since each cell (CELL x CELL pixels) below the horizon last changed."""

    def __init__(self, config: WatchdogConfig) -> None:
        self.config = config
        self._time: float | None = None
        self._pixels: NDArray[np.float32] = np.zeros(0, np.float32)
        self._means: NDArray[np.float32] = self._pixels
        self._frozen_for = self._same_for = np.zeros(0)

    def fault(self, observation: Observation) -> str:
        """What is wrong after one more frame, or nothing."""
        pixels = _below_horizon(observation.image)
        means = _cell_sums(pixels, _columns(pixels.shape[1], colors=3)) / np.float32(CELL**2)
        means = means.reshape(len(means), -1, 3)
        if self._time is None or pixels.shape != self._pixels.shape:
            self._means = means
            self._frozen_for = self._same_for = np.zeros(means.shape[:2])
        else:
            self._advance(pixels, means, _moved(observation, self._time))
        self._time, self._pixels = observation.time, pixels
        frozen = np.count_nonzero(self._frozen_for > self.config.frozen_metres)
        if frozen >= self.config.frozen_share * self._frozen_for.size:
            return f"the image has not changed for {self._frozen_for.min():.1f} m"
        if np.count_nonzero(self._same_for > self.config.covered_metres) >= self.config.covered_cells:
            return f"a part of the image has not changed for {self._same_for.max():.0f} m"
        return ""

    def _advance(self, pixels: NDArray[np.float32], means: NDArray[np.float32], metres: float) -> None:
        other = np.abs(means - self._means).max(-1) > self.config.change
        self._means = np.where(other[..., None], means, self._means)  # slow changes add up
        self._frozen_for = np.where(other, 0.0, self._frozen_for + metres)
        differences = _cell_sums(np.abs(pixels - self._pixels), _columns(pixels.shape[1], colors=1))
        self._same_for = np.where(differences > self.config.still * 3 * CELL**2, 0.0, self._same_for + metres)


def _below_horizon(image: Image) -> NDArray[np.float32]:
    """The lower part of an image, as far as whole cells cover it, in rows of bytes (rows, 3 W); a level camera has the
    horizon in the middle."""
    height, width = (side // CELL * CELL for side in image.shape[:2])
    top = math.ceil((image.shape[0] / 2 + CELL / 2) / CELL) * CELL
    return image[top:height, :width].reshape(height - top, -1).astype(np.float32)


@lru_cache(maxsize=8)
def _columns(width: int, colors: int) -> NDArray[np.float32]:
    """Ones (width, cells * colors) where a byte of a row belongs to a cell, and with three colours to one of them: a
    product with it adds them up, ten times as fast as a sum over axes."""
    byte = np.arange(width)
    cell = byte // (3 * CELL) * colors + byte % 3 % colors
    return np.asarray(cell[:, None] == np.arange(width // (3 * CELL) * colors), dtype=np.float32)


def _cell_sums(rows: NDArray[np.float32], columns: NDArray[np.float32]) -> NDArray[np.float32]:
    """Sums over cells (cell rows, columns of `_columns`)."""
    return np.asarray(rows.reshape(-1, CELL, rows.shape[1]).sum(axis=1) @ columns, dtype=np.float32)


def _moved(observation: Observation, before: float) -> float:
    """Metres since a time; none where speed or time make no sense."""
    metres = observation.speed * (observation.time - before)
    return metres if math.isfinite(metres) and metres > 0 else 0.0


def _plain(image: Image, least: float) -> str:
    pixels = image[::4, ::4].reshape(-1, 3).astype(np.float32)
    spread = float(np.sqrt(((pixels - pixels.mean(axis=0)) ** 2).mean(axis=0)).mean())
    return f"the image is one plain colour (deviation {spread:.1f})" if spread < least else ""


def _old(observation: Observation, oldest: float) -> str:
    """Whether an image is too old; where nobody says when it was taken, it is new."""
    if observation.image_time is None:
        return ""
    age = observation.time - observation.image_time
    return "" if age <= oldest else f"the image is {age:.1f} s old"
