"""What is drawn over a finished town: shadows of cars and people, lit lamps, rain."""

from __future__ import annotations

from collections.abc import Mapping

import moderngl
import numpy as np
from numpy.typing import NDArray

from caldrive.datatypes import LightState, Pose
from caldrive.geometry import moved
from caldrive.world.rendering.gl import gl_context
from caldrive.world.rendering.pinhole import Frustum
from caldrive.world.rendering.programs import programs
from caldrive.world.roads.network import LightPost
from caldrive.world.scene.furniture import LAMP_FACE, LAMP_HEIGHTS
from caldrive.world.scene.ground import KERB_HEIGHT

GLOW_FAR = 150.0  # m beyond which no lamp is drawn
GLOW_COLORS = {
    LightState.RED: (1.0, 0.10, 0.06),
    LightState.YELLOW: (1.0, 0.74, 0.10),
    LightState.GREEN: (0.12, 1.0, 0.42),
}
MOST = 1024  # shadows or lamps in one picture
SHADOW_REACH, LAMP_REACH = 6.0, 1.0  # m around an actor and a lamp that may be in view
STREAK = np.eye(8, dtype=np.float32)[7]  # added to a lamp, gives its streak on the road
Rows = NDArray[np.float32]  # (N, 8)


def _lamp(post: Pose, state: LightState) -> tuple[float, ...]:
    """Position of a post's lit lamp, the heading of the traffic it faces, its colour, and 0 for a lamp."""
    at = moved(post, forward=LAMP_FACE - 0.03)
    return at.x, at.y, LAMP_HEIGHTS[state.value] + KERB_HEIGHT, post.heading, *GLOW_COLORS[state], 0.0


class Overlays:
    """Draws with blending, in the order shadows, lamps, rain."""

    def __init__(self, posts: tuple[LightPost, ...]) -> None:
        gl, shared = gl_context(), programs()
        self._posts = posts
        self._shadow_rows, self._lamp_rows = (gl.buffer(reserve=32 * MOST, dynamic=True) for _ in range(2))
        corners = (shared.corners, "2f", "corner")
        shadows = (self._shadow_rows, "4f 4f/i", "stands", "extent")
        lamps = (self._lamp_rows, "4f 4f/i", "lamp", "tint")
        self._shadows = gl.vertex_array(shared.shadow, [corners, shadows])
        self._lamps = gl.vertex_array(shared.glow, [corners, lamps])
        self._rain = gl.vertex_array(shared.rain, [corners])
        self._last: tuple[Mapping[str, LightState], Rows] = ({}, np.zeros((0, 8), np.float32))

    def lit_lamps(self, lights: Mapping[str, LightState]) -> Rows:
        """Rows for `draw_lamps`, from what the lights show, by LightPost.id."""
        if lights != self._last[0]:
            rows = [_lamp(post.pose, lights[post.id]) for post in self._posts if post.id in lights]
            self._last = dict(lights), np.array(rows, dtype=np.float32).reshape(-1, 8)
        return self._last[1]

    def draw_shadows(self, frustum: Frustum, shadows: Rows) -> None:
        """Shadows of actors, as in `Actors.shadows`."""
        gl = gl_context()
        gl.enable(moderngl.BLEND)
        gl.blend_func = moderngl.SRC_ALPHA, moderngl.ONE_MINUS_SRC_ALPHA
        shadows = shadows[frustum.sees(shadows[:, :2], SHADOW_REACH)][:MOST]
        if len(shadows):
            self._shadow_rows.write(shadows)
            self._shadows.render(moderngl.TRIANGLE_STRIP, instances=len(shadows))

    def draw_lamps(self, frustum: Frustum, lamps: Rows, is_wet: bool) -> None:
        """Lit lamps, and on a wet road their streaks."""
        near = np.hypot(*(lamps[:, :2] - frustum.eye[:2]).T) < GLOW_FAR
        lamps = lamps[near & frustum.sees(lamps[:, :2], LAMP_REACH)][: MOST // 2]
        if not len(lamps):
            return
        if is_wet:
            lamps = np.concatenate((lamps, lamps + STREAK))
        gl_context().blend_func = moderngl.ONE, moderngl.ONE_MINUS_SRC_ALPHA
        self._lamp_rows.write(lamps)
        self._lamps.render(moderngl.TRIANGLE_STRIP, instances=len(lamps))

    def draw_rain(self) -> None:
        """Streaks over the whole picture."""
        gl = gl_context()
        gl.disable(moderngl.DEPTH_TEST)
        gl.blend_func = moderngl.SRC_ALPHA, moderngl.ONE_MINUS_SRC_ALPHA
        self._rain.render(moderngl.TRIANGLE_STRIP)
