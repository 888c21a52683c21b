"""Cars as low-poly meshes, lofted from cross-sections; length and width are scaled to the real ones when drawn.

Slots: 0 takes the vertex colour, 1 the paint, 2 and 3 the colours of tail and head lamps, 5 is glass.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from caldrive.world.scene.meshes import RGB, Mesh, box, disc, merge, quads

PAINT, TAIL, HEAD, GLASS = 1, 2, 3, 5
GLOWING = 8  # in the spare byte: lit by nothing but itself
LENGTH, WIDTH = 4.4, 1.8  # m, of the meshes
_GLASS: RGB = (38, 46, 56)

_TYRE: RGB = (24, 24, 26)

_RIM: RGB = (150, 152, 156)

_SILL = 0.24  # m above the road


@dataclass(frozen=True)
class Shape:
    """A car's side view: (x, height of the shoulder, height of the roof) from front to back; equal: no cabin there."""

    sections: tuple[tuple[float, float, float], ...]
    roof_width: float
    wheel: float
    axles: tuple[float, float]


SHAPES = (
    Shape(((2.2, 0.58, 0.58), (2.08, 0.78, 0.78), (0.95, 0.94, 0.94), (0.25, 0.95, 1.42), (-1.45, 0.97, 1.44),
           (-2.02, 0.98, 0.98), (-2.2, 0.80, 0.80)), 0.70, 0.32, (1.36, -1.30)),  # hatchback
    Shape(((2.2, 0.56, 0.56), (2.05, 0.74, 0.74), (0.85, 0.90, 0.90), (0.15, 0.92, 1.38), (-0.85, 0.93, 1.38),
           (-1.45, 0.95, 0.95), (-2.1, 0.93, 0.93), (-2.2, 0.72, 0.72)), 0.68, 0.32, (1.38, -1.34)),  # saloon
    Shape(((2.2, 0.72, 0.72), (2.1, 0.96, 0.96), (1.15, 1.08, 1.08), (0.55, 1.10, 1.74), (-1.85, 1.12, 1.72),
           (-2.15, 1.10, 1.10), (-2.2, 0.90, 0.90)), 0.76, 0.37, (1.36, -1.32)),  # off-roader
    Shape(((2.2, 0.72, 0.72), (2.12, 1.02, 1.02), (1.72, 1.16, 1.16), (1.15, 1.18, 1.98), (-2.12, 1.20, 2.02),
           (-2.2, 1.18, 1.18)), 0.84, 0.35, (1.42, -1.36)),  # van
)  # fmt: skip
HEIGHTS = tuple(max(roof for _, _, roof in shape.sections) for shape in SHAPES)


def _panels(shape: Shape) -> list[Mesh]:
    """Sides, windows and top between each pair of cross-sections, then the two ends."""
    half, roof = WIDTH / 2, WIDTH / 2 * shape.roof_width
    parts = []
    for (x0, s0, r0), (x1, s1, r1) in zip(shape.sections, shape.sections[1:], strict=False):
        w0, w1 = (roof if r > s else half * 0.94 for s, r in ((s0, r0), (s1, r1)))
        sloped = (r0 > s0) != (r1 > s1)
        lower, upper, top = [], [], []
        for y in (1, -1):
            side = [(x0, y * half, _SILL), (x1, y * half, _SILL), (x1, y * half, s1 - 0.06), (x0, y * half, s0 - 0.06)]
            bevel = [
                (x0, y * half, s0 - 0.06),
                (x1, y * half, s1 - 0.06),
                (x1, y * half * 0.94, s1),
                (x0, y * half * 0.94, s0),
            ]
            window = [(x0, y * half * 0.94, s0), (x1, y * half * 0.94, s1), (x1, y * w1, r1), (x0, y * w0, r0)]
            lower += [f[::y] for f in (side, bevel)]
            upper.append(window[::y])
        top = [[(x0, -w0, r0), (x0, w0, r0), (x1, w1, r1), (x1, -w1, r1)]]
        parts += [quads(lower, (255, 255, 255), slot=PAINT), quads(upper, _GLASS, slot=GLASS)]
        parts.append(quads(top, _GLASS, slot=GLASS) if sloped else quads(top, (255, 255, 255), slot=PAINT))
    for (x, s, r), facing in ((shape.sections[0], 1), (shape.sections[-1], -1)):
        w = half * 0.94
        end = [(x, -w, _SILL), (x, w, _SILL), (x, w, max(s, r)), (x, -w, max(s, r))]
        parts.append(quads([end[::facing]], (235, 235, 235), slot=PAINT))
    return parts


def _lamp(x: float, y: float, z: float, size: tuple[float, float], color: RGB, slot: int, spare: int = 0) -> Mesh:
    (a, b), facing = (size[0] / 2, size[1] / 2), 1 if x > 0 else -1
    corners = [(x, y - a, z - b), (x, y + a, z - b), (x, y + a, z + b), (x, y - a, z + b)]
    return quads([corners[::facing]], color, slot=slot, spare=spare)


def _ends(shape: Shape) -> list[Mesh]:
    """Lamps, grille, bumpers and number plates."""
    front, back = shape.sections[0], shape.sections[-1]
    x0, x1, high = front[0] + 0.015, back[0] - 0.015, back[1]
    parts = [
        _lamp(x0, 0.0, front[1] - 0.17, (0.8, 0.16), (28, 28, 30), 0),
        _lamp(x0, 0.0, 0.32, (1.5, 0.12), (44, 44, 46), 0),
    ]
    parts += [
        _lamp(x1, 0.0, 0.32, (1.6, 0.16), (44, 44, 46), 0),
        _lamp(x1, 0.0, high - 0.22, (0.5, 0.13), (232, 226, 190), 0),
    ]
    for y in (-0.64, 0.64):
        parts.append(_lamp(x0, y, front[1] - 0.13, (0.34, 0.17), (255, 255, 255), HEAD, GLOWING))
        parts.append(_lamp(x1, y, high - 0.17, (0.32, 0.24), (255, 255, 255), TAIL, GLOWING))
    return parts


def _wheels(shape: Shape) -> list[Mesh]:
    """Each wheel is a dark disc with a rim, flush with the side, and a block under the body."""
    parts, r = [], shape.wheel
    for x in shape.axles:
        for y in (1, -1):
            parts.append(disc((x, y * (WIDTH / 2 + 0.012), r), r, 8, _TYRE, y, axis="y"))
            parts.append(disc((x, y * (WIDTH / 2 + 0.02), r), r * 0.6, 6, _RIM, y, axis="y"))
            parts.append(box((x, y * (WIDTH / 2 - 0.11), r * 0.8), (2 * r * 0.86, 0.2, r * 1.6), _TYRE))
    return parts


def _pillars(shape: Shape) -> list[Mesh]:
    """A pillar in the middle of the side windows and the mirrors."""
    cabin = [section for section in shape.sections if section[2] > section[1]]
    (x0, s0, r0), (x1, _, _) = cabin[0], cabin[-1]
    middle, half, roof = (x0 + x1) / 2, WIDTH / 2 * 0.945, WIDTH / 2 * (shape.roof_width + 0.006)
    parts = []
    for y in (1, -1):
        corners = [
            (middle + 0.06, y * half, s0),
            (middle - 0.06, y * half, s0),
            (middle - 0.06, y * roof, r0),
            (middle + 0.06, y * roof, r0),
        ]
        parts.append(quads([corners[::y]], (255, 255, 255), slot=PAINT))
        parts.append(box((x0 + 0.4, y * 0.98, s0 + 0.1), (0.12, 0.2, 0.14), (255, 255, 255), slot=PAINT))
    return parts


def car_mesh(shape: Shape) -> Mesh:
    """A car seen from near, about 180 triangles."""
    return merge((*_panels(shape), *_ends(shape), *_wheels(shape), *_pillars(shape)))


def far_car_mesh(shape: Shape) -> Mesh:
    """The same car seen from afar, about 60 triangles: body, windows, lamps and the dark between the wheels."""
    tyres = [
        box((x, 0, shape.wheel * 0.75), (2 * shape.wheel * 0.85, WIDTH + 0.02, shape.wheel * 1.5), _TYRE)
        for x in shape.axles
    ]
    return merge((*_panels(shape), *(m for m in _ends(shape) if m.vertices["slot"][0] in (TAIL, HEAD)), *tyres))


def _rgb(*hexes: int) -> tuple[RGB, ...]:
    return tuple(((h >> 16) & 255, (h >> 8) & 255, h & 255) for h in hexes)


PAINTS: Sequence[RGB] = _rgb(
    0xB82626,
    0x2A4E9A,
    0xE6E6E2,
    0x2B2D31,
    0x9AA0A6,
    0x3E7A52,
    0xD8A62A,
    0x6C2A3C,
    0x5A8CC0,
    0xC86A2C,
    0x707A6A,
    0xD9CFB8,
)

TAIL_LAMP: RGB = (150, 22, 22)

BRAKE_LAMP: RGB = (255, 52, 40)

HEAD_LAMP: RGB = (238, 236, 222)
