"""The watchdog: notices that the camera has failed, from what its images do while the car moves.

A frame that is no picture at all is refused by `images.check_image`. This finds what needs more than one look: a
picture that stands still while the car does not, a part of it that never changes, and images unlike the recording's.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from caldrive.compiled import Floats, compiled, f32, i32
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

    def look(self, observation: Observation, outputs: Floats | None = None) -> None:
        """Raises BadImage, with what is wrong, where the camera has failed. outputs: of the camera check (1, 1 +
        reasons), None without one."""
        # A copy: a camera may fill the same memory again, and compiled code is made for one layout only.
        observation = replace(observation, image=np.array(observation.image, order="C"))
        faults = (  # each sees every frame, whatever the others say
            _old(observation, self.config.oldest),
            _plain(observation.image, self.config.least_spread),
            self._stillness.fault(observation),
            "" if outputs is None else self._unlike_recording(outputs),
        )
        if fault := next(filter(None, faults), ""):
            raise BadImage(f"{fault}: brake, and look at the camera")

    def _unlike_recording(self, outputs: Floats) -> str:
        """What is wrong with the images of the last seconds, or nothing."""
        self._evidence = np.concatenate((self._evidence[1:], evidence(outputs)))
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
        self._time = math.nan
        self._image = np.zeros((0, 0, 3), np.uint8)

    def fault(self, observation: Observation) -> str:
        """What is wrong after one more frame, or nothing."""
        image, metres, config = observation.image, _moved(observation, self._time), self.config
        if image.shape != self._image.shape:
            self._begin(image)
        _move_on(image, self._image, self._sums, self._changed, metres, (config.change, config.still))
        self._time, self._image = observation.time, image
        frozen_for, same_for = self._changed
        if np.count_nonzero(frozen_for > config.frozen_metres) >= config.frozen_share * frozen_for.size:
            return f"the image has not changed for {frozen_for.min():.1f} m"
        if np.count_nonzero(same_for > config.covered_metres) >= config.covered_cells:
            return f"a part of the image has not changed for {same_for.max():.0f} m"
        return ""

    def _begin(self, image: Image) -> None:
        """The first image: all cells are new."""
        height, width = image.shape[:2]
        cells = height // CELL - first_row(height), width // CELL
        self._image = image
        self._sums = np.full((*cells, 3), math.inf, np.float32)
        self._changed = np.zeros((2, *cells), np.float32)


def first_row(height: int) -> int:
    """The first row of cells below the horizon; a level camera has it in the middle."""
    return math.ceil((height / 2 + CELL / 2) / CELL)


@compiled
def _move_on(
    image: Image, before: Image, sums: Floats, changed: Floats, metres: float, limits: tuple[float, float]
) -> None:
    """The distances `changed` (2, rows, columns) since each cell's mean changed and since any of its pixels did, one
    frame and so many metres later. sums (rows, columns, 3): of a cell's bytes when its mean last changed, as slow
    changes add up; limits: change and still of `WatchdogConfig`."""
    change, still = f32(limits[0] * CELL**2), f32(limits[1] * 3 * CELL**2)
    rows, columns = sums.shape[:2]
    top = image.shape[0] // CELL - rows
    for row in range(rows):
        for column in range(columns):
            red, green, blue, difference = i32(0), i32(0), i32(0), i32(0)
            for y in range(CELL * (top + row), CELL * (top + row + 1)):
                for x in range(CELL * column, CELL * (column + 1)):
                    red += i32(image[y, x, 0])
                    green += i32(image[y, x, 1])
                    blue += i32(image[y, x, 2])
                    for color in range(3):
                        difference += abs(i32(image[y, x, color]) - i32(before[y, x, color]))
            cell, moved = sums[row, column], f32(metres)
            farthest = max(abs(f32(red) - cell[0]), abs(f32(green) - cell[1]), abs(f32(blue) - cell[2]))
            changed[0, row, column] += moved
            changed[1, row, column] += moved
            if farthest > change:
                cell[0], cell[1], cell[2] = f32(red), f32(green), f32(blue)
                changed[0, row, column] = f32(0)
            if f32(difference) > still:
                changed[1, row, column] = f32(0)


def _moved(observation: Observation, before: float) -> float:
    """Metres since a time; none where speed or time make no sense, as before the first frame."""
    metres = observation.speed * (observation.time - before)
    return metres if math.isfinite(metres) and metres > 0 else 0.0


def _plain(image: Image, least: float) -> str:
    spread = _spread(image)
    return f"the image is one plain colour (deviation {spread:.1f})" if spread < least else ""


@compiled
def _spread(image: Image) -> float:
    """The standard deviation of a colour's bytes, of every fourth pixel each way; the mean of the three."""
    spread = 0.0
    for color in range(3):
        n = total = squares = 0
        for y in range(0, image.shape[0], 4):
            for x in range(0, image.shape[1], 4):
                byte = int(image[y, x, color])
                n += 1
                total += byte
                squares += byte * byte
        spread += math.sqrt(squares / n - (total / n) ** 2) / 3
    return spread


def _old(observation: Observation, oldest: float) -> str:
    """Whether an image is too old; where nobody says when it was taken, it is new."""
    if observation.image_time is None:
        return ""
    age = observation.time - observation.image_time
    return "" if age <= oldest else f"the image is {age:.1f} s old"
