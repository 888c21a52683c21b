"""The light over a town: lighting, sky and shadows of each weather, made when they are first needed."""

from __future__ import annotations

import copy
import zlib
from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from typing import Any

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
from caldrive.world.scene.weather import Weather, as_weather, lighting

KEPT = 6  # shadows that are remembered, up to 64 MB each
KEPT_SKIES = 32  # weathers whose light and sky are remembered, below 1 MB each


class Atmosphere:
    """What all pictures of a town share, in each weather."""

    def __init__(self, roads: RoadNetwork, scenery: Sequence[Prop], appearance: Appearance) -> None:
        self.roads, self.scenery, self.appearance = roads, scenery, appearance
        self._lights: dict[tuple[Weather, Bounds], Light] = {}
        self._materials: dict[Weather, Materials] = {}
        self._skies: dict[Weather, Texels] = {}
        self._shadows: dict[tuple[float, Bounds], Integers] = {}  # by the sun's altitude, and what they cover

    def in_weather(self, given: int | Weather, x: float, y: float) -> tuple[Light, Materials]:
        """Light and materials in a weather, around a place in m. Raises ValueError for an unknown weather."""
        current, bounds = as_weather(given), shadow_bounds(self.roads.bounds, x, y)
        if (current, bounds) not in self._lights:
            self._make_room(self._lights)
            self._lights[current, bounds] = self._light(current, bounds)
        if current not in self._materials:
            self._make_room(self._materials)
            self._materials[current] = self._made(current)
        return self._lights[current, bounds], self._materials[current]

    @staticmethod
    def _make_room(kept: dict[Any, Any]) -> None:
        """Forgets the oldest of what is remembered, where that is much."""
        if len(kept) >= KEPT_SKIES:
            del kept[next(iter(kept))]

    def _light(self, current: Weather, bounds: Bounds) -> Light:
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

    def _made(self, current: Weather) -> Materials:
        paint = self.appearance.paint
        if current not in self._skies:
            self._make_room(self._skies)
            light = lighting(current, self.appearance.sun_azimuth)
            self._skies[current] = packed(panorama(current, light, zlib.crc32(self.roads.name.encode())))
        colors = [(*color, 0.0) for color in (paint.center, paint.edge, paint.asphalt)]
        return Materials(layers(), self._skies[current], np.array([*colors, paint.widths], np.float32))

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
