"""The light over a town: lighting, sky and shadows of each weather, made when they are first needed."""

from __future__ import annotations

import copy
import zlib
from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache

import numpy as np

from caldrive.compiled import Integers
from caldrive.world.rendering.light import Light, light_of, packed_shadows
from caldrive.world.rendering.texturing import Materials, Texels, packed, texels
from caldrive.world.roads.network import RoadNetwork
from caldrive.world.scene.appearance import Appearance, RoadPaint
from caldrive.world.scene.scenery import Prop
from caldrive.world.scene.shadows import Bounds, shadow_bounds, shadow_heights
from caldrive.world.scene.sky import panorama
from caldrive.world.scene.textures import texture_layers
from caldrive.world.scene.weather import lighting, weather

KEPT = 6  # shadows that are remembered, up to 64 MB each


class Atmosphere:
    """What all pictures of a town share, in each weather."""

    def __init__(self, roads: RoadNetwork, scenery: Sequence[Prop], appearance: Appearance) -> None:
        self.roads, self.scenery, self.appearance = roads, scenery, appearance
        self._lights: dict[tuple[int, Bounds], Light] = {}
        self._materials: dict[int, Materials] = {}
        self._skies: dict[int, Texels] = {}
        self._shadows: dict[tuple[float, Bounds], Integers] = {}  # by the sun's altitude, and what they cover

    def in_weather(self, id: int, x: float, y: float) -> tuple[Light, Materials]:
        """Light and materials in a weather, around a place in m. Raises ValueError for an unknown weather."""
        bounds = shadow_bounds(self.roads.bounds, x, y)
        if (id, bounds) not in self._lights:
            self._lights[id, bounds] = self._light(id, bounds)
        if id not in self._materials:
            self._materials[id] = self._made(id)
        return self._lights[id, bounds], self._materials[id]

    def _light(self, id: int, bounds: Bounds) -> Light:
        current = weather(id)
        light, key = lighting(current, self.appearance.sun_azimuth), (current.sun_altitude, bounds)
        if key not in self._shadows:
            if len(self._shadows) >= KEPT:
                self._forget(next(iter(self._shadows)))
            self._shadows[key] = packed_shadows(shadow_heights(self.scenery, bounds, light.sun_direction))
        return light_of(light, self._shadows[key], bounds)

    def _forget(self, key: tuple[float, Bounds]) -> None:
        """Forgets shadows, and the lights that hold on to them."""
        del self._shadows[key]
        for other in [other for other in self._lights if other[1] == key[1]]:
            del self._lights[other]

    def _made(self, id: int) -> Materials:
        current, paint = weather(id), self.appearance.paint
        if id not in self._skies:
            light = lighting(current, self.appearance.sun_azimuth)
            self._skies[id] = packed(panorama(current, light, zlib.crc32(self.roads.name.encode())))
        colors = [(*color, 0.0) for color in (paint.center, paint.edge, paint.asphalt)]
        return Materials(layers(), self._skies[id], np.array([*colors, paint.widths], np.float32))

    def with_paint(self, paint: RoadPaint) -> Atmosphere:
        """The same with other road markings; it shares lights and skies."""
        other = copy.copy(self)
        other.appearance, other._materials = replace(self.appearance, paint=paint), {}
        return other

    def close(self) -> None:
        """Forgets all of them."""
        self._lights.clear()
        self._materials.clear()
        self._skies.clear()
        self._shadows.clear()


@lru_cache(maxsize=1)
def layers() -> Texels:
    """The textures of the process."""
    return texels(texture_layers())
