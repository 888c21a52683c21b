"""Cars as low-poly meshes, lofted from cross-sections; length and width are scaled to the real ones when drawn."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from itertools import pairwise

from caldrive.world.scene.meshes import RGB, WHITE, Mesh, Point, Surface, box, disc, from_hex, merge, quads

LENGTH, WIDTH = 4.4, 1.8  # m, of the meshes
SILL = 0.24  # m above the road
GLOWING = 8  # in the spare byte of a vertex: lit by nothing but itself


class CarPart(IntEnum):
    """The slot of a vertex: which part of a car it is. PAINT, TAIL and HEAD take the instance's colours."""

    BODY = 0
    PAINT = 1
    TAIL = 2
    HEAD = 3
    GLASS = 5


@dataclass(frozen=True)
class CarShape:
    """A car's side view, in m.

    sections: (x, height of the shoulder, height of the roof) from front to back; equal heights: no cabin there.
    roof_width: share of the car's width. wheel: radius. axles: x of the front and the rear one.
    """

    sections: tuple[tuple[float, float, float], ...]
    roof_width: float
    wheel: float
    axles: tuple[float, float]

    @property
    def height(self) -> float:
        """Of the highest point of the roof, m."""
        return max(roof for _, _, roof in self.sections)


_GLASS: RGB = (38, 46, 56)
_PAINT = Surface(WHITE, slot=CarPart.PAINT)
_TYRE, _RIM = Surface((24, 24, 26)), Surface((150, 152, 156))
HATCHBACK = CarShape(
    sections=(
        (2.2, 0.58, 0.58), (2.08, 0.78, 0.78), (0.95, 0.94, 0.94), (0.25, 0.95, 1.42), (-1.45, 0.97, 1.44),
        (-2.02, 0.98, 0.98), (-2.2, 0.80, 0.80),
    ),
    roof_width=0.70, wheel=0.32, axles=(1.36, -1.30),
)  # fmt: skip
SALOON = CarShape(
    sections=(
        (2.2, 0.56, 0.56), (2.05, 0.74, 0.74), (0.85, 0.90, 0.90), (0.15, 0.92, 1.38), (-0.85, 0.93, 1.38),
        (-1.45, 0.95, 0.95), (-2.1, 0.93, 0.93), (-2.2, 0.72, 0.72),
    ),
    roof_width=0.68, wheel=0.32, axles=(1.38, -1.34),
)  # fmt: skip
OFF_ROADER = CarShape(
    sections=(
        (2.2, 0.72, 0.72), (2.1, 0.96, 0.96), (1.15, 1.08, 1.08), (0.55, 1.10, 1.74), (-1.85, 1.12, 1.72),
        (-2.15, 1.10, 1.10), (-2.2, 0.90, 0.90),
    ),
    roof_width=0.76, wheel=0.37, axles=(1.36, -1.32),
)  # fmt: skip
VAN = CarShape(
    sections=(
        (2.2, 0.72, 0.72), (2.12, 1.02, 1.02), (1.72, 1.16, 1.16), (1.15, 1.18, 1.98), (-2.12, 1.20, 2.02),
        (-2.2, 1.18, 1.18),
    ),
    roof_width=0.84, wheel=0.35, axles=(1.42, -1.36),
)  # fmt: skip
SHAPES = (HATCHBACK, SALOON, OFF_ROADER, VAN)
PAINTS: Sequence[RGB] = from_hex(
    0xB82626, 0x2A4E9A, 0xE6E6E2, 0x2B2D31, 0x9AA0A6, 0x3E7A52, 0xD8A62A, 0x6C2A3C, 0x5A8CC0, 0xC86A2C, 0x707A6A,
    0xD9CFB8,
)  # fmt: skip
TAIL_LAMP: RGB = (150, 22, 22)
BRAKE_LAMP: RGB = (255, 52, 40)
HEAD_LAMP: RGB = (238, 236, 222)


def car_mesh(shape: CarShape) -> Mesh:
    """A car seen from near, about 180 triangles."""
    return merge((*_panels(shape), *_grille_and_bumpers(shape), *_lamps(shape), *_wheels(shape), *_pillars(shape)))


def far_car_mesh(shape: CarShape) -> Mesh:
    """The same car seen from afar, about 60 triangles: body, windows, lamps and the dark between the wheels."""
    size = (2 * shape.wheel * 0.85, WIDTH + 0.02, shape.wheel * 1.5)
    tyres = [box((x, 0, shape.wheel * 0.75), size, _TYRE) for x in shape.axles]
    return merge((*_panels(shape), *_lamps(shape), *tyres))


def _panels(shape: CarShape) -> list[Mesh]:
    """Sides, windows and top between each pair of cross-sections, then the two ends."""
    parts: list[Mesh] = []
    for front, back in pairwise(shape.sections):
        parts += _panels_between(front, back, WIDTH / 2 * shape.roof_width)
    for (x, shoulder, roof), facing in ((shape.sections[0], 1), (shape.sections[-1], -1)):
        w, top = WIDTH / 2 * 0.94, max(shoulder, roof)
        end = [(x, -w, SILL), (x, w, SILL), (x, w, top), (x, -w, top)]
        parts.append(quads([end[::facing]], (235, 235, 235), slot=CarPart.PAINT))
    return parts


def _panels_between(
    front: tuple[float, float, float], back: tuple[float, float, float], half_roof: float
) -> tuple[Mesh, Mesh, Mesh]:
    """Sides, windows and top between two cross-sections; half_roof: half the roof's width in m."""
    (x0, s0, r0), (x1, s1, r1), half = front, back, WIDTH / 2
    w0, w1 = (half_roof if roof > shoulder else half * 0.94 for shoulder, roof in ((s0, r0), (s1, r1)))
    sides, windows = [], []
    for y in (1, -1):
        wide, narrow = y * half, y * half * 0.94
        door = [(x0, wide, SILL), (x1, wide, SILL), (x1, wide, s1 - 0.06), (x0, wide, s0 - 0.06)]
        bevel = [(x0, wide, s0 - 0.06), (x1, wide, s1 - 0.06), (x1, narrow, s1), (x0, narrow, s0)]
        window = [(x0, narrow, s0), (x1, narrow, s1), (x1, y * w1, r1), (x0, y * w0, r0)]
        sides += [face[::y] for face in (door, bevel)]
        windows.append(window[::y])
    top = [[(x0, -w0, r0), (x0, w0, r0), (x1, w1, r1), (x1, -w1, r1)]]
    is_windscreen = (r0 > s0) != (r1 > s1)
    color, part = (_GLASS, CarPart.GLASS) if is_windscreen else (WHITE, CarPart.PAINT)
    return (
        quads(sides, WHITE, slot=CarPart.PAINT), quads(windows, _GLASS, slot=CarPart.GLASS),
        quads(top, color, slot=part),
    )  # fmt: skip


def _plate(at: Point, size: tuple[float, float], color: RGB, part: CarPart = CarPart.BODY, spare: int = 0) -> Mesh:
    """A flat plate (width, height) on the car's front or, for x < 0, its back."""
    (x, y, z), (a, b), facing = at, (size[0] / 2, size[1] / 2), 1 if at[0] > 0 else -1
    corners = [(x, y - a, z - b), (x, y + a, z - b), (x, y + a, z + b), (x, y - a, z + b)]
    return quads([corners[::facing]], color, slot=part, spare=spare)


def _ends(shape: CarShape) -> tuple[float, float, float, float]:
    """Where plates of the front and of the back lie, and how high its shoulder is there: x, x, z, z."""
    (front, high_front, _), (back, high_back, _) = shape.sections[0], shape.sections[-1]
    return front + 0.015, back - 0.015, high_front, high_back


def _grille_and_bumpers(shape: CarShape) -> list[Mesh]:
    """With the number plate."""
    front, back, high_front, high_back = _ends(shape)
    return [
        _plate((front, 0.0, high_front - 0.17), (0.8, 0.16), (28, 28, 30)),
        _plate((front, 0.0, 0.32), (1.5, 0.12), (44, 44, 46)),
        _plate((back, 0.0, 0.32), (1.6, 0.16), (44, 44, 46)),
        _plate((back, 0.0, high_back - 0.22), (0.5, 0.13), (232, 226, 190)),
    ]


def _lamps(shape: CarShape) -> list[Mesh]:
    front, back, high_front, high_back = _ends(shape)
    parts = []
    for y in (-0.64, 0.64):
        parts.append(_plate((front, y, high_front - 0.13), (0.34, 0.17), WHITE, CarPart.HEAD, GLOWING))
        parts.append(_plate((back, y, high_back - 0.17), (0.32, 0.24), WHITE, CarPart.TAIL, GLOWING))
    return parts


def _wheels(shape: CarShape) -> list[Mesh]:
    """Each wheel is a dark disc with a rim, flush with the side, and a block under the body."""
    parts, r = [], shape.wheel
    for x in shape.axles:
        for y in (1, -1):
            parts.append(disc((x, y * (WIDTH / 2 + 0.012), r), r, 8, _TYRE, facing=y, axis="y"))
            parts.append(disc((x, y * (WIDTH / 2 + 0.02), r), r * 0.6, 6, _RIM, facing=y, axis="y"))
            parts.append(box((x, y * (WIDTH / 2 - 0.11), r * 0.8), (2 * r * 0.86, 0.2, r * 1.6), _TYRE))
    return parts


def _pillars(shape: CarShape) -> list[Mesh]:
    """A pillar in the middle of the side windows, and the mirrors."""
    cabin = [section for section in shape.sections if section[2] > section[1]]
    (x0, s0, r0), (x1, _, _) = cabin[0], cabin[-1]
    middle, half, roof = (x0 + x1) / 2, WIDTH / 2 * 0.945, WIDTH / 2 * (shape.roof_width + 0.006)
    front, back = middle + 0.06, middle - 0.06
    parts = []
    for y in (1, -1):
        pillar = [(front, y * half, s0), (back, y * half, s0), (back, y * roof, r0), (front, y * roof, r0)]
        parts.append(quads([pillar[::y]], WHITE, slot=CarPart.PAINT))
        parts.append(box((x0 + 0.4, y * 0.98, s0 + 0.1), (0.12, 0.2, 0.14), _PAINT))
    return parts
