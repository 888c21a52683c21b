"""What is shaded: a spot of a picture, what it is seen by, and what holds for all of them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from caldrive.compiled import Floats, inlined
from caldrive.world.rendering.light import Light
from caldrive.world.rendering.pinhole import View
from caldrive.world.rendering.texturing import Materials


class Scene(NamedTuple):
    """What holds for a whole picture."""

    materials: Materials
    light: Light
    camera: View


class Spot(NamedTuple):
    """Where a pixel shows a triangle."""

    column: np.float32
    """In pixels, 0 in the middle of the first."""
    row: np.float32
    """Likewise."""
    w: np.float32
    """m ahead of the camera, along its axis."""
    share: np.float32
    """Of the pixel, in [0, 1]."""


@inlined
def at(planes: Floats, k: int, spot: Spot) -> np.float32:
    """The value of the k-th plane at a spot, see `fragments.make_planes`."""
    value: np.float32 = planes[3 * k] + planes[3 * k + 1] * spot.column + planes[3 * k + 2] * spot.row
    return value


@inlined
def place(view: View, spot: Spot) -> tuple[np.float32, np.float32, np.float32]:
    """What a spot shows, in the world: x, y, z in m."""
    return (
        view.position[0] + spot.w * (view.ahead[0] + spot.column * view.right[0] + spot.row * view.down[0]),
        view.position[1] + spot.w * (view.ahead[1] + spot.column * view.right[1] + spot.row * view.down[1]),
        view.position[2] + spot.w * (view.ahead[2] + spot.column * view.right[2] + spot.row * view.down[2]),
    )
