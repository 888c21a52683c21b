"""Asphalt: grain, tracks, road markings, and water that mirrors the sky."""

from __future__ import annotations

import numpy as np

from caldrive.compiled import Floats, f32, inlined
from caldrive.world.rendering.light import clarity, sunshine
from caldrive.world.rendering.spots import Scene, Spot, at, place
from caldrive.world.rendering.texturing import Texels, level_of, texture
from caldrive.world.scene.ground import JUNCTION_HALF_WIDTH
from caldrive.world.scene.patterns import SIZE
from caldrive.world.scene.streets import Border
from caldrive.world.scene.textures import Tex

EDGE, DIVIDER, SOLID_CENTER = (f32(int(border)) for border in (Border.EDGE, Border.DIVIDER, Border.SOLID_CENTER))
ASPHALT = int(Tex.ASPHALT)
FINE, COARSE, PUDDLES = f32(0.14), f32(0.019), f32(0.043)  # repetitions of the grain in a metre
NO_LANE = f32(JUNCTION_HALF_WIDTH - 0.1)  # m of half width from which on there is none
THINNEST = f32(1e-4)  # of a pixel's footprint
STOP_MIDDLE, STOP_HALF = f32(0.6), f32(0.25)  # m before the lane's end, and half its width
ZERO, HALF, ONE, TWO, PER_BYTE = f32(0.0), f32(0.5), f32(1.0), f32(2.0), f32(1 / 255)
CENTER_PAINT, EDGE_PAINT, BARE, WIDTHS = range(4)  # rows of Materials.paint


@inlined
def shade_road(out: Floats, planes: Floats, flat: Floats, scene: Scene, spot: Spot) -> None:
    """Adds the share of a spot to the colour (3,) of its pixel. planes: lane; flat: lines and half width (m)."""
    light, paint, layers = scene.light, scene.materials.paint, scene.materials.layers
    x, y, _ = place(scene.camera, spot)
    metres = ground_in_a_pixel(planes, scene, spot, x, y)
    fine = grain(layers, metres, FINE, x, y)
    left, right, stop, across = markings(planes, flat, paint[WIDTHS], spot)
    rough = fine * (f32(0.45) + f32(0.7) * grain(layers, metres, COARSE, y, x))
    if flat[2] < NO_LANE:
        rough *= ONE - f32(0.09) * max(ONE - f32(2.2) * abs(abs(across) - f32(0.85)), ZERO)
    center = paint[EDGE_PAINT] if flat[0] == EDGE or flat[0] == DIVIDER else paint[CENTER_PAINT]
    wear = f32(0.55) + HALF * fine
    left, other = left * wear, max(right, stop) * wear
    shine, clear = sunshine(light, x, y, ZERO, 0), clarity(light, spot.w)
    mirror, glint, climb, dry = ZERO, ZERO, ZERO, ONE
    if light.wetness > ZERO:
        mirror, glint, climb, dry = water(layers, metres, scene, x, y)
    for k in range(3):
        albedo = paint[BARE, k] * rough
        albedo += left * (center[k] - albedo)
        albedo += other * (paint[EDGE_PAINT, k] - albedo)
        color = dry * albedo * (light.sky_ambient[k] + light.sun[k] * light.sun_direction[2] * shine)
        sky = light.horizon[k] + climb * (light.zenith[k] - light.horizon[k]) + glint * light.sun[k] * shine
        color += mirror * (sky - color)
        out[k] += spot.share * (light.horizon[k] + clear * (color - light.horizon[k]))


@inlined
def markings(
    planes: Floats, flat: Floats, widths: Floats, spot: Spot
) -> tuple[np.float32, np.float32, np.float32, np.float32]:
    """How much of a pixel the left, the right and the stop line cover, and m to the left of the lane's middle."""
    across, across_size = _lane(planes, 1, spot)
    along, along_size = _lane(planes, 2, spot)
    stop, stop_size = _lane(planes, 3, spot)
    is_edge, left, right = flat[0] == EDGE, ZERO, ZERO
    if flat[0] > ZERO:
        inset, half = (widths[2], widths[1]) if is_edge else (ZERO, widths[0])
        left = stripe(across, across_size, flat[2] - inset, half)
        if not is_edge and flat[0] != SOLID_CENTER:
            far = min(max(TWO * along_size - f32(0.6), ZERO), ONE)
            dash = stripe(along - np.floor(along), along_size, HALF, HALF * widths[3])
            left *= dash + far * (widths[3] - dash)
    if flat[1] == EDGE:
        right = stripe(across, across_size, widths[2] - flat[2], widths[1])
    return left, right, stripe(stop, stop_size, STOP_MIDDLE, STOP_HALF), across


@inlined
def _lane(planes: Floats, k: int, spot: Spot) -> tuple[np.float32, np.float32]:
    """The k-th value of a triangle at a spot, and by how much it changes within a pixel."""
    value = at(planes, k, spot) * spot.w
    right, down = (planes[3 * k + 1] - value * planes[1]) * spot.w, (planes[3 * k + 2] - value * planes[2]) * spot.w
    return value, max(abs(right) + abs(down), THINNEST)


@inlined
def stripe(at: np.float32, footprint: np.float32, middle: np.float32, half_width: np.float32) -> np.float32:
    """How much of a pixel's footprint a line covers: far lines fade and do not flicker."""
    low, high = max(at - HALF * footprint, middle - half_width), min(at + HALF * footprint, middle + half_width)
    return min(max((high - low) / footprint, ZERO), ONE)


@inlined
def ground_in_a_pixel(
    planes: Floats, scene: Scene, spot: Spot, x: np.float32, y: np.float32
) -> tuple[np.float32, np.float32, np.float32, np.float32]:
    """By how many m x and y of the ground change from a pixel to the one on its right, and to the one below."""
    view, w = scene.camera, spot.w
    right, down = -w * planes[1], -w * planes[2]  # by how much of itself w changes
    return (
        (x - view.position[0]) * right + w * view.right[0], (y - view.position[1]) * right + w * view.right[1],
        (x - view.position[0]) * down + w * view.down[0], (y - view.position[1]) * down + w * view.down[1],
    )  # fmt: skip


@inlined
def grain(
    layers: Texels, metres: tuple[np.float32, np.float32, np.float32, np.float32], scale: np.float32,
    u: np.float32, v: np.float32,
) -> np.float32:  # fmt: skip
    """The asphalt's pattern, in [0, 1], at a place in m. scale: its repetitions in a metre."""
    level = level_of(metres[0] * scale, metres[1] * scale, metres[2] * scale, metres[3] * scale, SIZE)
    red, _, _ = texture(layers[ASPHALT], SIZE, level, u * scale, v * scale)
    return red


@inlined
def water(
    layers: Texels, metres: tuple[np.float32, np.float32, np.float32, np.float32], scene: Scene,
    x: np.float32, y: np.float32,
) -> tuple[np.float32, np.float32, np.float32, np.float32]:  # fmt: skip
    """Of wet asphalt: how much it mirrors, the sun's glint, how far up the sky it shows lies (0 horizon, 1 zenith), and
    how bright it is itself."""
    light, eye = scene.light, scene.camera.position
    dx, dy, dz = x - eye[0], y - eye[1], -eye[2]
    inverse = ONE / np.sqrt(dx * dx + dy * dy + dz * dz)
    dx, dy, dz = dx * inverse, dy * inverse, dz * inverse
    puddle = (grain(layers, metres, PUDDLES, x, y) + f32(0.42) * light.puddles - f32(0.96)) * f32(14.0)
    puddle = min(max(puddle, ZERO), ONE)
    steep = ONE + dz
    fresnel = f32(0.03) + f32(0.97) * steep * steep * steep * steep * steep
    glint = max(dx * light.sun_direction[0] + dy * light.sun_direction[1] - dz * light.sun_direction[2], ZERO)
    for _ in range(5):
        glint *= glint
    mirror = fresnel * (HALF * light.wetness + f32(0.35) * puddle)
    return mirror, glint, min(max(f32(-2.5) * dz, ZERO), ONE), ONE - f32(0.30) * light.wetness - f32(0.15) * puddle
