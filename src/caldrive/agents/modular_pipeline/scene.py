"""What the modular pipeline sees: the paper's five classes of pixels, and whether a junction is near (S.2.1)."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import Protocol

import numpy as np

from caldrive.compiled import Floats
from caldrive.datatypes import Image, Semantic

JUNCTION_AHEAD = 10.0  # m to a junction from which the car counts as at it


class SceneClass(IntEnum):
    """The five classes, as channels of `Scene.classes`."""

    ROAD = 0
    SIDEWALK = 1
    LANE_MARKING = 2
    DYNAMIC = 3
    STATIC = 4


MERGED = {  # of a recording's classes those that are not STATIC
    Semantic.ROAD: SceneClass.ROAD,
    Semantic.SIDEWALK: SceneClass.SIDEWALK,
    Semantic.LINE: SceneClass.LANE_MARKING,
    Semantic.VEHICLE: SceneClass.DYNAMIC,
    Semantic.PERSON: SceneClass.DYNAMIC,
}
SCENE_CLASS = np.array([MERGED.get(kind, SceneClass.STATIC) for kind in Semantic], np.uint8)
"""(12,): the number of the `SceneClass` by that of the `Semantic`."""


@dataclass(frozen=True)
class Scene:
    """What a camera's image shows."""

    classes: Floats
    """(H, W, 5): the probability of each `SceneClass` at each place; it may be coarser than the image."""
    junction: float
    """The probability that the car is in a junction, or right before one."""


class Segmenter(Protocol):
    """An image to what it shows."""

    def segment(self, image: Image) -> Scene:
        """What an image (H, W, 3) shows."""
        ...
