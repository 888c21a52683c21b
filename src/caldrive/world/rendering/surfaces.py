"""The surfaces of a picture and their shading: what stands still, asphalt, cars and people, the sky.

A triangle carries values that change from corner to corner (`fragments.planes`), and such that hold for all of it:

    STANDING  u, v, lit, sunlit                  layer, what is added to x and y for its shadow (m), 1 without trees
    EVEN      u, v                               the same, then lit and sunlit, which are the same at all corners
    ROAD      lane (see scene/ground.py)         the left and the right line, half width in m
    ACTOR     lit, sunlit, z                     x, y of where it stands, in m
    SKY       u, v
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from caldrive.compiled import Floats, Integers, compiled, f32, inlined
from caldrive.world.rendering.fragments import Fragments, fragments_of
from caldrive.world.rendering.light import Light, clarity, sunshine
from caldrive.world.rendering.road_surface import shade_road
from caldrive.world.rendering.spots import Scene, Spot, at, place
from caldrive.world.rendering.texturing import Color, Texels, level_of, panorama_color, texture
from caldrive.world.scene.patterns import SIZE

STANDING, EVEN, ROAD, ACTOR, SKY = range(5)
COUNTS = (8, 2, 3, 7, 2)  # values of each kind
VALUES, FLATS = max(COUNTS), 10  # of a triangle, at most
ROWS = 8  # of a picture that are shaded at a time: their fragments stay in the cache
ONE = f32(1.0)


class Surfaces(NamedTuple):
    """What the triangles of a picture are made of."""

    kinds: Integers
    """(N,): STANDING, EVEN, ROAD, ACTOR or SKY."""
    planes: Floats
    """(N, 3 + 3 VALUES): of 1/w and of each value, see `fragments.make_planes`."""
    flats: Floats
    """(N, FLATS)."""
    classes: Integers
    """(N,) of `Semantic`; asphalt has lines."""


@compiled
def shade(shown: Integers, surfaces: Surfaces, scene: Scene, room: Fragments, picture: Floats) -> None:
    """Draws a picture (H W, 3) in [0, 1] of the triangles that its samples (2 H, 2 W) show. room: for ROWS of its
    rows."""
    rows = shown.shape[0] // 2
    picture[:] = f32(0.0)
    for first in range(0, rows, ROWS):
        for k in range(fragments_of(shown, first, min(first + ROWS, rows), room)):
            triangle = room.triangle[k]
            kind, planes, flat = surfaces.kinds[triangle], surfaces.planes[triangle], surfaces.flats[triangle]
            spot = Spot(room.column[k], room.row[k], ONE, room.share[k])
            spot = Spot(spot.column, spot.row, ONE / at(planes, 0, spot), spot.share)
            out = picture[room.pixel[k]]
            if kind == EVEN:
                shade_even(out, planes, flat, scene, spot)
            elif kind == STANDING:
                shade_standing(out, planes, flat, scene, spot)
            elif kind == ROAD:
                shade_road(out, planes, flat, scene, spot)
            elif kind == ACTOR:
                shade_actor(out, planes, flat, scene.light, spot)
            else:
                shade_sky(out, planes, scene.materials.panorama, spot)


@inlined
def shade_even(out: Floats, planes: Floats, flat: Floats, scene: Scene, spot: Spot) -> None:
    """Adds the share of a spot to the colour (3,) of its pixel: a texture in light and shade."""
    texel, sun = texture_in_light(planes, flat, scene, spot)
    clear = clarity(scene.light, spot.w)
    bright, haze = spot.share * clear, spot.share * (ONE - clear)
    for k in range(3):
        out[k] += haze * scene.light.horizon[k] + bright * texel[k] * (flat[4 + k] + sun * flat[7 + k])


@inlined
def shade_standing(out: Floats, planes: Floats, flat: Floats, scene: Scene, spot: Spot) -> None:
    """Likewise, of a surface that is not as bright everywhere."""
    texel, sun = texture_in_light(planes, flat, scene, spot)
    clear = clarity(scene.light, spot.w)
    bright, haze = spot.share * clear * spot.w, spot.share * (ONE - clear)
    for k in range(3):
        lit = at(planes, 3 + k, spot) + sun * at(planes, 6 + k, spot)
        out[k] += haze * scene.light.horizon[k] + bright * texel[k] * lit


@inlined
def texture_in_light(planes: Floats, flat: Floats, scene: Scene, spot: Spot) -> tuple[Color, np.float32]:
    """A texture's colour at a spot, and how much of the sun it is in."""
    w = spot.w
    u, v = at(planes, 1, spot) * w, at(planes, 2, spot) * w
    level = level_of(
        (planes[4] - u * planes[1]) * w, (planes[7] - v * planes[1]) * w,
        (planes[5] - u * planes[2]) * w, (planes[8] - v * planes[2]) * w, SIZE,
    )  # fmt: skip
    x, y, z = place(scene.camera, spot)
    sun = sunshine(scene.light, x + flat[1], y + flat[2], z, int(flat[3]))
    return texture(scene.materials.layers[int(flat[0])], SIZE, level, u, v), sun


@inlined
def shade_actor(out: Floats, planes: Floats, flat: Floats, light: Light, spot: Spot) -> None:
    """Likewise: painted, and shaded as a whole where it stands."""
    sun, clear = sunshine(light, flat[0], flat[1], at(planes, 7, spot) * spot.w, 0), clarity(light, spot.w)
    bright, haze = spot.share * clear * spot.w, spot.share * (ONE - clear)
    for k in range(3):
        out[k] += haze * light.horizon[k] + bright * (at(planes, 1 + k, spot) + sun * at(planes, 4 + k, spot))


@inlined
def shade_sky(out: Floats, planes: Floats, panorama: Texels, spot: Spot) -> None:
    """Likewise: the panorama on its dome."""
    color = panorama_color(panorama, at(planes, 1, spot) * spot.w, at(planes, 2, spot) * spot.w)
    for k in range(3):
        out[k] += spot.share * color[k]
