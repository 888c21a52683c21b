"""What is drawn over a finished picture: shadows of cars and people, lit lamps, rain."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from caldrive.compiled import Floats, Integers, compiled, f32, i32, inlined
from caldrive.datatypes import LightState, Pose
from caldrive.geometry import moved
from caldrive.world.rendering.fragments import make_planes
from caldrive.world.rendering.light import Light, clarity, sunshine
from caldrive.world.rendering.pinhole import View
from caldrive.world.rendering.rasteriser import POLYGON, clipped, in_samples, span
from caldrive.world.rendering.spots import Spot, at
from caldrive.world.roads.network import LightPost
from caldrive.world.scene.furniture import LAMP_FACE, LAMP_HEIGHTS, LAMP_RADIUS
from caldrive.world.scene.ground import KERB_HEIGHT

GLOW_FAR = f32(150.0)  # m beyond which no lamp is drawn
GLOW_COLORS = {
    LightState.RED: (1.0, 0.10, 0.06),
    LightState.YELLOW: (1.0, 0.74, 0.10),
    LightState.GREEN: (0.12, 1.0, 0.42),
}
HALO = 2.4  # radii of a lamp's light around it
STREAK = np.eye(8, dtype=np.float32)[7]  # added to a lamp, as often as it is strong, gives its streak on the road
Rows = NDArray[np.float32]  # (N, 8)
WHOLE = f32(1 / 4)  # of a pixel, a sample's share
ZERO, HALF, ONE, TWO = f32(0.0), f32(0.5), f32(1.0), f32(2.0)
SAME_HEIGHT = f32(1.00002)  # of 1/w: what lies on the ground may be hidden by nothing but what stands before it


class Lamps:
    """The lamps of a town's traffic lights."""

    def __init__(self, posts: tuple[LightPost, ...]) -> None:
        self._posts = posts
        self._last: tuple[Mapping[str, LightState], Rows] = ({}, np.zeros((0, 8), np.float32))

    def lit(self, lights: Mapping[str, LightState], wetness: float) -> Rows:
        """Rows for `draw_lamps`, from what the lights show, by LightPost.id; on a wet road also their streaks."""
        if lights != self._last[0]:
            shown = {post.stands_at: lights[post.id] for post in self._posts if post.id in lights}
            rows = [_lamp(*of_post) for of_post in shown.items()]
            self._last = dict(lights), np.array(rows, dtype=np.float32).reshape(-1, 8)
        lamps = self._last[1]
        return np.concatenate((lamps, lamps + STREAK * np.float32(0.40 * wetness))) if wetness > 0 else lamps


def _lamp(post: Pose, state: LightState) -> tuple[float, ...]:
    """Position of a post's lit lamp, the heading of the traffic it faces, its colour, and 0 for a lamp."""
    at = moved(post, forward=LAMP_FACE - 0.03)
    return at.x, at.y, LAMP_HEIGHTS[state.value] + KERB_HEIGHT, post.heading, *GLOW_COLORS[state], 0.0


class Scratch(NamedTuple):
    """Room for one quadrilateral."""

    corners: Floats
    """(4, 3): clip coordinates."""
    values: Floats
    """(3, 4)."""
    planes: Floats
    """(15,)."""
    polygon: Floats
    """(POLYGON, 4)."""
    hits: Integers
    """(pixels, 3): row, column and samples of those that it covers."""


def scratch_for(size: tuple[int, int]) -> Scratch:
    """Room for what lies over pictures of a size (width, height)."""
    corners, values, planes, polygon = (np.zeros(shape, np.float32) for shape in ((4, 3), (3, 4), 15, (POLYGON, 4)))
    return Scratch(corners, values, planes, polygon, np.empty((size[0] * size[1], 3), np.int32))


@compiled
def draw_shadows(picture: Floats, depths: Floats, shadows: Rows, matrix: Floats, light: Light, room: Scratch) -> None:
    """Darkens a picture (H, W, 3) where boxes throw shadows: their footprints swept away from the sun as far as their
    heights throw them, and the dark under them.

    shadows: x, y, heading, height, half length, half width, darkness underneath, height of the ground.
    """
    quad, values, planes, hits = room.corners, room.values, room.planes, room.hits
    direct = (light.sun[0] + light.sun[1] + light.sun[2]) / f32(3.0) * light.sun_direction[2]
    sky = (light.sky_ambient[0] + light.sky_ambient[1] + light.sky_ambient[2]) / f32(3.0)
    for shadow in shadows:
        cosine, sine = np.cos(shadow[2]), np.sin(shadow[2])
        thrown_x = -light.sun_direction[0] / light.sun_direction[2] * shadow[3]
        thrown_y = -light.sun_direction[1] / light.sun_direction[2] * shadow[3]
        sweep_x = cosine * thrown_x + sine * thrown_y + f32(1e-4)
        sweep_y = cosine * thrown_y - sine * thrown_x + f32(1e-4)
        length = np.sqrt(sweep_x * sweep_x + sweep_y * sweep_y)
        for k in range(4):
            right, up = (f32(1.0) if k in (1, 2) else f32(-1.0)), (f32(1.0) if k > 1 else f32(-1.0))
            x = right * (shadow[4] + f32(0.3)) + (sweep_x if right * sweep_x > ZERO else ZERO)
            y = up * (shadow[5] + f32(0.3)) + (sweep_y if up * sweep_y > ZERO else ZERO)
            ground_x, ground_y = cosine * x - sine * y + shadow[0], sine * x + cosine * y + shadow[1]
            _to_clip(quad[k], matrix, ground_x, ground_y, shadow[7])
            if k < 3:
                values[k, 0], values[k, 1], values[k, 2], values[k, 3] = x, y, ground_x, ground_y
        make_planes(quad, values, picture.shape[1], picture.shape[0], planes)
        for h in range(_covered(room, depths)):
            row, column, spot = hits[h, 0], hits[h, 1], _spot_of(hits[h], planes)
            x, y = at(planes, 1, spot) * spot.w, at(planes, 2, spot) * spot.w
            swept = _inside(x, y, shadow[4], shadow[5], sweep_x, sweep_y) * length * f32(4.0)
            swept = min(max(swept, ZERO), ONE) * direct / (direct + sky)
            swept *= sunshine(light, at(planes, 3, spot) * spot.w, at(planes, 4, spot) * spot.w, f32(0.1), 0)
            beyond_x = max(abs(x) - shadow[4] + f32(0.15), ZERO)
            beyond_y = max(abs(y) - shadow[5] + f32(0.15), ZERO)
            under = shadow[6] * max(ONE - (beyond_x * beyond_x + beyond_y * beyond_y) * f32(5.0), ZERO)
            left = ONE - spot.share * max(swept, under) * clarity(light, spot.w)
            for c in range(3):
                picture[row, column, c] *= left


@inlined
def _inside(
    x: np.float32, y: np.float32, half_length: np.float32, half_width: np.float32, sweep_x: np.float32,
    sweep_y: np.float32,
) -> np.float32:  # fmt: skip
    """Through how much of its sweep a footprint covers a place, in [0, 1], or less than 0."""
    a, b = (x - half_length) / sweep_x, (x + half_length) / sweep_x
    c, d = (y - half_width) / sweep_y, (y + half_width) / sweep_y
    return min(min(max(a, b), max(c, d)), ONE) - max(max(min(a, b), min(c, d)), ZERO)


@compiled
def draw_lamps(picture: Floats, depths: Floats, lamps: Rows, view: View, room: Scratch) -> None:
    """Draws lit lamps for those before them: a lens with a halo, never smaller than a pixel or so.

    lamps: x, y, z, heading of the traffic that it faces, colour, and how strong a streak on a wet road it is, 0 for the
    lamp itself.
    """
    quad, values, planes, hits = room.corners, room.values, room.planes, room.hits
    matrix, eye, focal = view.matrix, view.position, view.focal
    for lamp in lamps:
        dx, dy, dz = lamp[0] - eye[0], lamp[1] - eye[1], lamp[2] - eye[2]
        cosine, sine = np.cos(lamp[3]), np.sin(lamp[3])
        away, flat = np.sqrt(dx * dx + dy * dy + dz * dz), np.sqrt(dx * dx + dy * dy)
        if dx * cosine + dy * sine <= ZERO or away > GLOW_FAR:  # seen from behind, or hardly
            continue
        radius = f32(LAMP_RADIUS)
        size = f32(HALO) * min(max(f32(1.25) * away / focal, radius), f32(2.2) * radius)
        for k in range(4):
            right, up = (f32(1.0) if k in (1, 2) else f32(-1.0)), (f32(1.0) if k > 1 else f32(-1.0))
            x, y, z = lamp[0] + size * right * sine, lamp[1] - size * right * cosine, lamp[2] + size * up
            if lamp[7] > ZERO:
                along, across = up * f32(0.36) * away / flat, right * f32(0.26) / flat
                x = eye[0] + f32(0.55) * dx + dx * along + dy * across
                y = eye[1] + f32(0.55) * dy + dy * along - dx * across
                z = f32(0.03)
            _to_clip(quad[k], matrix, x, y, z)
            if k < 3:
                values[k, 0], values[k, 1] = right, up
        make_planes(quad, values, picture.shape[1], picture.shape[0], planes)
        for h in range(_covered(room, depths)):
            row, column, spot = hits[h, 0], hits[h, 1], _spot_of(hits[h], planes)
            x, y = at(planes, 1, spot) * spot.w, at(planes, 2, spot) * spot.w
            radii = f32(HALO) * np.sqrt(x * x + y * y)
            rest = max(ONE - radii / f32(HALO), ZERO)
            core = min(max((f32(1.05) - radii) * f32(5.0), ZERO), ONE) if lamp[7] == ZERO else ZERO
            white = f32(0.35) * max(ONE - f32(1.6) * radii, ZERO)
            halo = rest * rest * (lamp[7] if lamp[7] > ZERO else f32(0.75) * (ONE - core))
            for c in range(3):
                shine = (lamp[4 + c] + white * (ONE - lamp[4 + c])) * core + lamp[4 + c] * halo
                picture[row, column, c] += spot.share * (shine - core * picture[row, column, c])


@compiled
def draw_rain(picture: Floats, drops: Floats, focal: np.float32, time: np.float32, light: Light) -> None:
    """Two layers of streaks over the whole picture, that move with the time (s). drops: (size, size) in [0, 1]."""
    height, width, size = picture.shape[0], picture.shape[1], drops.shape[0]
    seed = time * f32(7.3) % ONE
    strength = f32(0.35) + f32(0.65) * light.rain
    red, green, blue = _streak_color(light.horizon[0]), _streak_color(light.horizon[1]), _streak_color(light.horizon[2])
    for row in range(height):
        y = (HALF * f32(height) - HALF - f32(row)) / focal
        near_row, near_up = _texel(y * f32(0.5) + f32(2.7) * time + f32(3.0) * seed, size)
        far_row, far_up = _texel(y * f32(0.9) + f32(1.9) * time + seed, size)
        for column in range(width):
            x = (f32(column) + HALF - HALF * f32(width)) / focal
            near = _drop(drops, x * f32(0.9) + seed, near_row, near_up)
            far = _drop(drops, x * f32(1.9) + f32(0.31) + TWO * seed, far_row, far_up)
            streak = (near * f32(0.30) + far * f32(0.22)) * strength
            pixel = picture[row, column]
            pixel[0] += streak * (red - pixel[0])
            pixel[1] += streak * (green - pixel[1])
            pixel[2] += streak * (blue - pixel[2])


@inlined
def _streak_color(horizon: np.float32) -> np.float32:
    """Of a channel: rain is as bright as the sky behind it, and whiter."""
    color: np.float32 = horizon + f32(0.4) * (f32(0.9) - horizon)
    return color


@inlined
def _texel(u: np.float32, size: int) -> tuple[int, np.float32]:
    """The texel before a place u, of so many (a power of two) in each whole, and the share of the way to the next."""
    u = (u - np.floor(u) + ONE) * f32(size) - HALF
    whole = i32(u)
    return int(whole) & (size - 1), u - f32(whole)


@inlined
def _drop(drops: Floats, u: np.float32, row: int, up: np.float32) -> np.float32:
    """How much of a streak is at a place u along a row of drops, by a share up of the way to the next row."""
    mask = drops.shape[0] - 1
    column, right = _texel(u, mask + 1)
    a, b = drops[row, column], drops[row, (column + 1) & mask]
    c, d = drops[(row + 1) & mask, column], drops[(row + 1) & mask, (column + 1) & mask]
    low, high = a + right * (b - a), c + right * (d - c)
    between: np.float32 = low + up * (high - low)
    return between


@inlined
def _spot_of(hit: Integers, planes: Floats) -> Spot:
    """Where a quadrilateral is seen, by a row of `Scratch.hits`."""
    spot = Spot(f32(hit[1]), f32(hit[0]), ONE, WHOLE * f32(hit[2]))
    return Spot(spot.column, spot.row, ONE / at(planes, 0, spot), spot.share)


@inlined
def _to_clip(corner: Floats, matrix: Floats, x: np.float32, y: np.float32, z: np.float32) -> None:
    for axis in range(3):
        corner[axis] = matrix[axis, 0] * x + matrix[axis, 1] * y + matrix[axis, 2] * z + matrix[axis, 3]


@compiled
def _covered(room: Scratch, depths: Floats) -> int:
    """Writes row, column and samples of each pixel in which a quadrilateral is seen; returns how many. depths: of what
    hides it."""
    rows, columns = depths.shape
    polygon, planes, hits = room.polygon, room.planes, room.hits
    size, n = clipped(room.corners, polygon), 0
    if size < 3:
        return 0
    in_samples(polygon, size, columns, rows)
    top, bottom = polygon[0, 1], polygon[0, 1]
    for k in range(1, size):
        top, bottom = min(top, polygon[k, 1]), max(bottom, polygon[k, 1])
    if bottom < ZERO or top > f32(rows - 1):
        return 0
    for row in range(i32(max(top, ZERO)) // 2, i32(min(bottom, f32(rows - 1))) // 2 + 1):
        a, b = span(polygon, size, f32(2 * row), columns)
        c, d = span(polygon, size, f32(2 * row + 1), columns)
        first, last = min(a if a < b else columns, c if c < d else columns), max(b if a < b else 0, d if c < d else 0)
        for column in range(first // 2, (last + 1) // 2):
            samples = 0
            for k in range(4):
                x, y = 2 * column + (k & 1), 2 * row + (k >> 1)
                if (c if k > 1 else a) <= x < (d if k > 1 else b):
                    spot = Spot(f32(x) * HALF - f32(0.25), f32(y) * HALF - f32(0.25), ONE, ONE)
                    samples += 1 if at(planes, 0, spot) * SAME_HEIGHT >= depths[y, x] else 0
            if samples:
                hits[n, 0], hits[n, 1], hits[n, 2] = row, column, samples
                n += 1
    return n
