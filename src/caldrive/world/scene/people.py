"""People as low-poly meshes of 1.75 m, scaled when drawn; legs and arms swing in the vertex shader."""

from __future__ import annotations

from collections.abc import Sequence
from enum import Flag, IntEnum, auto

import numpy as np
from numpy.typing import NDArray

from caldrive.world.scene.meshes import RGB, WHITE, Mesh, Surface, box, from_hex, lathe, merge, smooth

HEIGHT = 1.75  # m, of the meshes
HIP_HEIGHT, SHOULDER_HEIGHT = 0.88, 1.42  # m, what legs and arms turn about


class BodyPart(IntEnum):
    """The slot of a vertex: which of the instance's colours it takes."""

    UPPER = 1
    TROUSERS = 2
    SKIN = 3
    HAIR = 4


class Limb(IntEnum):
    """The spare byte of a vertex: the limb that it swings with."""

    LEFT_LEG = 1
    RIGHT_LEG = 2
    LEFT_ARM = 3
    RIGHT_ARM = 4


class Shown(Flag):
    """What is drawn of a person."""

    LEGS = auto()
    """Up to the hips."""
    TORSO = auto()
    """All above."""
    SHADOW = auto()
    WHOLE = LEGS | TORSO | SHADOW


def _surface(part: BodyPart, limb: int = 0) -> Surface:
    """White, which the instance's colours tint."""
    return Surface(WHITE, slot=part, spare=limb)


UPPERS: Sequence[RGB] = from_hex(
    0xC23B3B, 0x2F5AA8, 0xE8E4DA, 0x2E2E34, 0x3F8A5C, 0xE0B23C, 0x7A4A9A, 0xD9772E, 0x6FA7C7, 0xB85C88
)
TROUSERS: Sequence[RGB] = from_hex(0x2B3A58, 0x26262A, 0x5A5048, 0x8A8478, 0x3C4A3A, 0x6E2E34)
SKINS: Sequence[RGB] = from_hex(0xF0CBB0, 0xD9A883, 0xA8744E, 0x6E4630)
HAIRS: Sequence[RGB] = from_hex(0x2A2220, 0x5A3A24, 0xB98A4A, 0x8A8683, 0x7A2E1C)


def heights(seeds: NDArray[np.int64]) -> NDArray[np.float64]:
    """How tall the people (N,) with some seeds are: between 1.6 and 1.9 m."""
    return 1.6 + (seeds // 11 % 31) / 100


def person_mesh() -> Mesh:
    """A person seen from near, about 130 triangles."""
    torso = box((0, 0, 1.16), (0.21, 0.36, 0.60), _surface(BodyPart.UPPER), top=1.12)
    hips = box((0, 0, 0.86), (0.20, 0.34, 0.14), _surface(BodyPart.TROUSERS))
    return merge((*_legs(), torso, hips, *_arms(), *_head(6)))


def far_person_mesh() -> Mesh:
    """A person seen from afar, about 50 triangles."""
    legs = [
        box((0, y, 0.45), (0.2, 0.17, 0.9), _surface(BodyPart.TROUSERS, limb))
        for y, limb in ((0.1, Limb.LEFT_LEG), (-0.1, Limb.RIGHT_LEG))
    ]
    torso = box((0, 0, 1.16), (0.23, 0.52, 0.62), _surface(BodyPart.UPPER))
    head = box((0, 0, 1.56), (0.2, 0.19, 0.22), _surface(BodyPart.SKIN))
    hair = box((-0.02, 0, 1.70), (0.22, 0.21, 0.12), _surface(BodyPart.HAIR))
    return merge((*legs, torso, head, hair))


def half_of(mesh: Mesh, half: Shown) -> Mesh:
    """The triangles of a person's mesh that are LEGS or TORSO."""
    first = mesh.vertices[mesh.triangles[:, 0]]
    legs = (first["slot"] == BodyPart.TROUSERS) | np.isin(first["spare"], (Limb.LEFT_LEG, Limb.RIGHT_LEG))
    return Mesh(mesh.vertices, mesh.triangles[legs == (half is Shown.LEGS)])


def _legs() -> list[Mesh]:
    parts = []
    for y, limb in ((0.1, Limb.LEFT_LEG), (-0.1, Limb.RIGHT_LEG)):
        parts.append(box((0, y, 0.47), (0.17, 0.16, 0.84), _surface(BodyPart.TROUSERS, limb), top=1.15))
        parts.append(box((0.05, y, 0.045), (0.27, 0.11, 0.09), Surface((44, 38, 36), spare=limb)))
    return parts


def _arms() -> list[Mesh]:
    parts = []
    for y, limb in ((0.28, Limb.LEFT_ARM), (-0.28, Limb.RIGHT_ARM)):
        parts.append(box((0, y, 1.17), (0.12, 0.11, 0.52), _surface(BodyPart.UPPER, limb), top=1.2))
        parts.append(box((0, y, 0.86), (0.09, 0.08, 0.14), _surface(BodyPart.SKIN, limb)))
    return parts


def _head(sides: int) -> list[Mesh]:
    """Face and hair as bodies of revolution with so many sides."""
    face = lathe(((0.05, 1.42), (0.11, 1.53), (0.105, 1.67), (0.0, 1.74)), sides, _surface(BodyPart.SKIN))
    hair = lathe(((0.12, 1.60), (0.125, 1.69), (0.0, 1.76)), sides, _surface(BodyPart.HAIR), at=(-0.025, 0))
    return [smooth(face, (0, 0, 1.6)), smooth(hair, (0, 0, 1.6))]
