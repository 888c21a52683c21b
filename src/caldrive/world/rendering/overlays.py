"""What is drawn over a finished town: shadows of cars and people, lit lamps, rain."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache

import moderngl
import numpy as np
from numpy.typing import NDArray

from caldrive.datatypes import LightState, Pose
from caldrive.geometry import moved
from caldrive.world.rendering.gl import gl_context
from caldrive.world.rendering.lens import View
from caldrive.world.rendering.programs import programs
from caldrive.world.roads.network import LightPost
from caldrive.world.scene.furniture import LAMP_FACE, LAMPS
from caldrive.world.scene.ground import KERB_HEIGHT

GLOW_FAR = 150.0  # m
GLOWS = {LightState.RED: (1.0, 0.10, 0.06), LightState.YELLOW: (1.0, 0.74, 0.10), LightState.GREEN: (0.12, 1.0, 0.42)}
MOST = 1024  # shadows or lamps in one picture
Rows = NDArray[np.float32]


@lru_cache(maxsize=4096)
def _lens(post: Pose, state: LightState) -> tuple[float, ...]:
    """Position of a post's lit lamp, the heading of the traffic it faces, its colour, and 0 for a lamp."""
    at = moved(post, LAMP_FACE - 0.03)
    return at.x, at.y, LAMPS[state.value] + KERB_HEIGHT, post.heading, *GLOWS[state], 0.0


class Overlays:
    """Draws with blending, in the order shadows, lamps, rain."""

    def __init__(self, posts: tuple[LightPost, ...]) -> None:
        gl, made = gl_context(), programs()
        self._posts = posts
        self._thrown, self._lamps = (gl.buffer(reserve=32 * MOST, dynamic=True) for _ in range(2))
        corners = (made.corners, "2f", "corner")
        self._shadow_array = gl.vertex_array(made.shadow, [corners, (self._thrown, "4f 4f/i", "stands", "extent")])
        self._glow_array = gl.vertex_array(made.glow, [corners, (self._lamps, "4f 4f/i", "lamp", "tint")])
        self._rain_array = gl.vertex_array(made.rain, [corners])
        self._last: tuple[Mapping[str, LightState], Rows] = ({}, np.zeros((0, 8), np.float32))

    def lit(self, lights: Mapping[str, LightState]) -> Rows:
        """The lit lamps (N, 8), for `lamps`."""
        if lights != self._last[0]:
            rows = [_lens(post.pose, lights[post.id]) for post in self._posts if post.id in lights]
            self._last = dict(lights), np.array(rows, dtype=np.float32).reshape(-1, 8)
        return self._last[1]

    def shadows(self, view: View, thrown: Rows) -> None:
        """Shadows of actors, as in `Actors.shadows`."""
        gl = gl_context()
        gl.enable(moderngl.BLEND)
        gl.blend_func = moderngl.SRC_ALPHA, moderngl.ONE_MINUS_SRC_ALPHA
        thrown = thrown[view.sees(thrown[:, :2], 6.0)][:MOST]
        if len(thrown):
            self._thrown.write(thrown)
            self._shadow_array.render(moderngl.TRIANGLE_STRIP, instances=len(thrown))

    def lamps(self, view: View, lit: Rows, wet: bool) -> None:
        """Lit lamps, and on a wet road their streaks."""
        near = np.hypot(*(lit[:, :2] - view.eye[:2]).T) < GLOW_FAR
        lit = lit[near & view.sees(lit[:, :2], 1.0)][: MOST // 2]
        if not len(lit):
            return
        if wet:
            lit = np.concatenate((lit, lit + np.eye(8, dtype=np.float32)[7]))
        gl_context().blend_func = moderngl.ONE, moderngl.ONE_MINUS_SRC_ALPHA
        self._lamps.write(lit)
        self._glow_array.render(moderngl.TRIANGLE_STRIP, instances=len(lit))

    def rain(self) -> None:
        """Streaks over the whole picture."""
        gl = gl_context()
        gl.disable(moderngl.DEPTH_TEST)
        gl.blend_func = moderngl.SRC_ALPHA, moderngl.ONE_MINUS_SRC_ALPHA
        self._rain_array.render(moderngl.TRIANGLE_STRIP)
