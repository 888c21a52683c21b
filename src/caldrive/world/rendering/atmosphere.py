"""The light over a town, on the graphics side: look, sky and shadows of the weather that holds."""

from __future__ import annotations

import zlib
from collections.abc import Sequence

import moderngl
import numpy as np

from caldrive.world.rendering.gl import smooth_texture
from caldrive.world.rendering.programs import programs
from caldrive.world.roads.network import RoadNetwork
from caldrive.world.scene.decor import Decor
from caldrive.world.scene.scenery import Prop
from caldrive.world.scene.shadows import shadow_heights, town_bounds
from caldrive.world.scene.sky import panorama
from caldrive.world.scene.weather import Look, look, weather


class Atmosphere:
    """What all pictures of a town in one weather share. Skies and shadows are made when they are first needed."""

    def __init__(self, roads: RoadNetwork, scenery: Sequence[Prop], decor: Decor) -> None:
        self.roads, self.scenery, self.decor = roads, scenery, decor
        self._prepared: dict[int, tuple[Look, moderngl.Texture]] = {}
        self._shadows: dict[float, moderngl.Texture] = {}

    def enter(self, id: int) -> Look:
        """Makes a weather the one that holds. Raises ValueError for an unknown one."""
        w, made = weather(id), programs()
        if id not in self._prepared:
            sky = look(w, self.decor.sun)
            picture = panorama(w, sky, zlib.crc32(self.roads.name.encode()))
            self._prepared[id] = sky, smooth_texture(picture, wraps=True)
        sky, dome = self._prepared[id]
        if w.sun_altitude not in self._shadows:
            heights = shadow_heights(self.scenery, town_bounds(self.roads.bounds), sky.sun_direction)
            self._shadows[w.sun_altitude] = smooth_texture(heights)
        if made.current != (self, id):
            made.current = (self, id)
            self._bind(sky, dome, self._shadows[w.sun_altitude])
        return sky

    def _bind(self, sky: Look, dome: moderngl.Texture, shadows: moderngl.Texture) -> None:
        made = programs()
        made.lighting.write(self._block(sky))
        made.lighting.bind_to_uniform_block(1)
        made.layers.use(0)
        for unit, texture in ((1, shadows), (2, dome), (3, made.drops)):
            texture.use(unit)
        paint = self.decor.paint
        made.road["center_color"], made.road["edge_color"] = paint.center, paint.edge
        made.road["asphalt"], made.road["widths"] = paint.asphalt, paint.stripes

    def _block(self, sky: Look) -> bytes:
        x0, y0, x1, y1 = town_bounds(self.roads.bounds)
        rows = [
            (*sky.sun_direction, 0), (*sky.sun, 0), (*sky.sky_ambient, 0), (*sky.ground_ambient, 0),
            (*sky.horizon, sky.fog_density), (*sky.zenith, 0), (sky.wetness, sky.puddles, sky.rain, 0),
            (x0, y0, 1 / (x1 - x0), 1 / (y1 - y0)),
        ]  # fmt: skip
        return np.array(rows, dtype="f4").tobytes()

    def close(self) -> None:
        """Forgets all skies and shadows."""
        self._prepared.clear()
        self._shadows.clear()
