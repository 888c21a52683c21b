"""The light over a town, on the graphics side: lighting, sky and shadows of the weather that holds."""

from __future__ import annotations

import zlib
from collections.abc import Sequence

import moderngl
import numpy as np

from caldrive.world.rendering.gl import smooth_texture
from caldrive.world.rendering.programs import BLOCKS, SAMPLERS, programs
from caldrive.world.roads.network import RoadNetwork
from caldrive.world.scene.appearance import Appearance
from caldrive.world.scene.scenery import Prop
from caldrive.world.scene.shadows import shadow_bounds, shadow_heights
from caldrive.world.scene.sky import panorama
from caldrive.world.scene.weather import Lighting, lighting, weather


class Atmosphere:
    """What all pictures of a town in one weather share. Skies and shadows are made when they are first needed."""

    def __init__(self, roads: RoadNetwork, scenery: Sequence[Prop], appearance: Appearance) -> None:
        self.roads, self.scenery, self.appearance = roads, scenery, appearance
        self._skies: dict[int, tuple[Lighting, moderngl.Texture]] = {}  # by weather
        self._shadows: dict[float, moderngl.Texture] = {}  # by the sun's altitude

    def use_weather(self, id: int) -> Lighting:
        """Makes a weather the one that holds. Raises ValueError for an unknown one."""
        current = weather(id)
        if id not in self._skies:
            light = lighting(current, self.appearance.sun_azimuth)
            picture = panorama(current, light, zlib.crc32(self.roads.name.encode()))
            self._skies[id] = light, smooth_texture(picture, wraps=True)
        light, sky = self._skies[id]
        if current.sun_altitude not in self._shadows:
            heights = shadow_heights(self.scenery, shadow_bounds(self.roads.bounds), light.sun_direction)
            self._shadows[current.sun_altitude] = smooth_texture(heights)
        if programs().current != (self, id):
            programs().current = (self, id)
            self._bind(light, sky, self._shadows[current.sun_altitude])
        return light

    def _bind(self, light: Lighting, sky: moderngl.Texture, shadows: moderngl.Texture) -> None:
        """Puts everything that the shaders need of a weather and town in its place."""
        shared, paint = programs(), self.appearance.paint
        shared.lighting.write(self._block(light))
        shared.lighting.bind_to_uniform_block(BLOCKS["Lighting"])
        shared.layers.use(SAMPLERS.index("layers"))
        for sampler, texture in (("shadows", shadows), ("panorama", sky), ("drops", shared.drops)):
            texture.use(SAMPLERS.index(sampler))
        shared.road["center_color"], shared.road["edge_color"] = paint.center, paint.edge
        shared.road["asphalt"], shared.road["widths"] = paint.asphalt, paint.widths

    def _block(self, light: Lighting) -> bytes:
        """The uniform block Lighting, see shaders/blocks.glsl."""
        x0, y0, x1, y1 = shadow_bounds(self.roads.bounds)
        rows = [
            (*light.sun_direction, 0),
            (*light.sun, 0),
            (*light.sky_ambient, 0),
            (*light.ground_ambient, 0),
            (*light.horizon, light.fog_density),
            (*light.zenith, 0),
            (light.wetness, light.puddles, light.rain, 0),
            (x0, y0, 1 / (x1 - x0), 1 / (y1 - y0)),
        ]
        return np.array(rows, dtype="f4").tobytes()

    def close(self) -> None:
        """Forgets all skies and shadows."""
        self._skies.clear()
        self._shadows.clear()
