"""The light over a town, on the graphics side: look, sky and shadows of the weather that holds."""

from __future__ import annotations

import zlib
from collections.abc import Sequence

import moderngl
import numpy as np

from caldrive.world.gl import programs, smooth_texture
from caldrive.world.roads import RoadNetwork
from caldrive.world.scenery import Prop
from caldrive.world.shadows import shadow_heights, town_bounds
from caldrive.world.sky import panorama
from caldrive.world.weather import Look, look, weather

SUN_AZIMUTH = {"town01": 0.95, "town02": 2.5}  # rad
PAINT = {  # colours of centre lines, edge lines and asphalt; half widths, inset of the edge line, share of a dash
    "town01": ((0.93, 0.70, 0.20), (0.92, 0.92, 0.90), (0.50, 0.50, 0.51), (0.10, 0.075, 0.28, 0.5)),
    "town02": ((0.95, 0.82, 0.42), (0.88, 0.88, 0.86), (0.58, 0.56, 0.54), (0.09, 0.06, 0.18, 0.42)),
}


class Atmosphere:
    """What all pictures of a town in one weather share. Skies and shadows are made when they are first needed."""

    def __init__(self, roads: RoadNetwork, scenery: Sequence[Prop]) -> None:
        self.roads, self.scenery = roads, scenery
        self._prepared: dict[int, tuple[Look, moderngl.Texture]] = {}
        self._shadows: dict[float, moderngl.Texture] = {}

    def enter(self, id: int) -> Look:
        """Makes a weather the one that holds. Raises ValueError for an unknown one."""
        w, made = weather(id), programs()
        if id not in self._prepared:
            sky = look(w, SUN_AZIMUTH[self.roads.style])
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
        made.look.write(self._block(sky))
        made.look.bind_to_uniform_block(1)
        made.layers.use(0)
        for unit, texture in ((1, shadows), (2, dome), (3, made.drops)):
            texture.use(unit)
        names = ("center_color", "edge_color", "asphalt", "widths")
        for name, value in zip(names, PAINT[self.roads.style], strict=True):
            made.road[name] = value

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
