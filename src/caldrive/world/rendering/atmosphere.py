"""The light over a town: lighting, sky and shadows of each weather, made when they are first needed."""

from __future__ import annotations

import zlib
from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from caldrive.compiled import Integers
from caldrive.world.rendering.light import Light, light_of, packed_shadows
from caldrive.world.rendering.texturing import Materials, Texels, packed, texels
from caldrive.world.roads.network import RoadNetwork
from caldrive.world.scene.appearance import Appearance
from caldrive.world.scene.scenery import Prop
from caldrive.world.scene.shadows import shadow_bounds, shadow_heights
from caldrive.world.scene.sky import panorama
from caldrive.world.scene.textures import texture_layers
from caldrive.world.scene.weather import lighting, weather


class Atmosphere:
    """What all pictures of a town share, in each weather."""

    def __init__(self, roads: RoadNetwork, scenery: Sequence[Prop], appearance: Appearance) -> None:
        self.roads, self.scenery, self.appearance = roads, scenery, appearance
        self._weathers: dict[int, tuple[Light, Materials]] = {}
        self._shadows: dict[float, Integers] = {}  # by the sun's altitude

    def in_weather(self, id: int) -> tuple[Light, Materials]:
        """Light and materials in a weather. Raises ValueError for an unknown one."""
        if id not in self._weathers:
            self._weathers[id] = self._made(id)
        return self._weathers[id]

    def _made(self, id: int) -> tuple[Light, Materials]:
        current, bounds, paint = weather(id), shadow_bounds(self.roads.bounds), self.appearance.paint
        light = lighting(current, self.appearance.sun_azimuth)
        if current.sun_altitude not in self._shadows:
            self._shadows[current.sun_altitude] = packed_shadows(
                shadow_heights(self.scenery, bounds, light.sun_direction)
            )
        sky = packed(panorama(current, light, zlib.crc32(self.roads.name.encode())))
        colors = [(*color, 0.0) for color in (paint.center, paint.edge, paint.asphalt)]
        materials = Materials(layers(), sky, np.array([*colors, paint.widths], np.float32))
        return light_of(light, self._shadows[current.sun_altitude], bounds), materials

    def close(self) -> None:
        """Forgets all of them."""
        self._weathers.clear()
        self._shadows.clear()


@lru_cache(maxsize=1)
def layers() -> Texels:
    """The textures of the process."""
    return texels(texture_layers())
