"""CARLA's axes and ours.

CARLA: left-handed, x forward, y right, z up, degrees; yaw + to the right, pitch + nose up, roll + right side down. Ours
(ISO 8855): y left, headings counter-clockwise, radians. Both in m.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from caldrive.datatypes import Pose


@dataclass(frozen=True)
class Placement:
    """Where something is in space, and how it is turned, in our axes: m and rad."""

    x: float = 0.0
    y: float = 0.0
    z: float = 0.0
    heading: float = 0.0
    pitch: float = 0.0
    """+ when its nose is up."""
    roll: float = 0.0
    """+ when its right side is down."""

    @property
    def pose(self) -> Pose:
        """On the plane."""
        return Pose(self.x, self.y, self.heading)


def standing(pose: Pose, z: float = 0.0) -> Placement:
    """Upright at a pose, z m above the ground."""
    return Placement(pose.x, pose.y, z, pose.heading)


def to_carla(place: Placement) -> tuple[float, float, float, float, float, float]:
    """x, y, z, pitch, yaw, roll as CARLA has them."""
    return (
        place.x, -place.y, place.z,
        math.degrees(place.pitch), -math.degrees(place.heading), math.degrees(place.roll),
    )  # fmt: skip


def from_carla(x: float, y: float, z: float, pitch: float, yaw: float, roll: float) -> Placement:
    """What CARLA's numbers say in our axes."""
    return Placement(x, -y, z, -math.radians(yaw), math.radians(pitch), math.radians(roll))


def vector_to_carla(x: float, y: float, z: float = 0.0) -> tuple[float, float, float]:
    """A velocity, an acceleration or a place in CARLA's axes; from CARLA's to ours it is the same."""
    return x, -y, z


def compose(parent: Placement, child: Placement) -> Placement:
    """Where something is whose place is given relative to something else."""
    if parent.pitch == parent.roll == 0.0:  # as of everything on the ground
        c, s = math.cos(parent.heading), math.sin(parent.heading)
        return Placement(
            parent.x + c * child.x - s * child.y, parent.y + s * child.x + c * child.y, parent.z + child.z,
            math.remainder(parent.heading + child.heading, math.tau), child.pitch, child.roll,
        )  # fmt: skip
    turned = rotation(parent)
    x, y, z = (np.array((parent.x, parent.y, parent.z)) + turned @ (child.x, child.y, child.z)).tolist()
    r = (turned @ rotation(child)).tolist()
    pitch = math.asin(max(-1.0, min(1.0, r[2][0])))
    return Placement(x, y, z, math.atan2(r[1][0], r[0][0]), pitch, math.atan2(r[2][1], r[2][2]))


def rotation(place: Placement) -> NDArray[np.float64]:
    """(3, 3): from its own axes to the world's."""
    (ch, sh), (cp, sp), (cr, sr) = (
        (math.cos(angle), math.sin(angle)) for angle in (place.heading, place.pitch, place.roll)
    )
    heading = np.array(((ch, -sh, 0), (sh, ch, 0), (0, 0, 1)))
    pitch = np.array(((cp, 0, -sp), (0, 1, 0), (sp, 0, cp)))
    return np.asarray(heading @ pitch @ np.array(((1, 0, 0), (0, cr, -sr), (0, sr, cr))))
