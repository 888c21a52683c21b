"""OpenGL without a display: the process's one context, its programs and textures, and picture targets."""

from __future__ import annotations

from functools import lru_cache

import moderngl
import numpy as np
from numpy.typing import NDArray

from caldrive.world import shaders
from caldrive.world.textures import texture_layers

import os
SAMPLES = int(os.environ.get("S", "4"))  # of antialiasing


@lru_cache(maxsize=1)
def gl_context() -> moderngl.Context:
    """The process's one OpenGL context. Raises RuntimeError where the machine has no EGL."""
    try:
        return moderngl.create_standalone_context(require=330, backend="egl")
    except Exception as error:  # moderngl raises bare Exceptions here
        raise RuntimeError(
            f"found no EGL with OpenGL 3.3 ({error}): type apt-get install libegl1 libgl1-mesa-dri"
        ) from error


class Programs:
    """The compiled programs with their shared blocks, and what all towns share on the graphics side."""

    def __init__(self) -> None:
        gl = gl_context()
        self.frame, self.look = gl.buffer(reserve=96, dynamic=True), gl.buffer(reserve=128, dynamic=True)
        self.static = self._program(shaders.STATIC_VERTEX, shaders.STATIC_FRAGMENT)
        self.road = self._program(shaders.ROAD_VERTEX, shaders.ROAD_FRAGMENT)
        self.actor = self._program(shaders.ACTOR_VERTEX, shaders.ACTOR_FRAGMENT)
        self.shadow = self._program(shaders.SHADOW_VERTEX, shaders.SHADOW_FRAGMENT)
        self.glow = self._program(shaders.GLOW_VERTEX, shaders.GLOW_FRAGMENT)
        self.sky = self._program(shaders.SKY_VERTEX, shaders.SKY_FRAGMENT)
        self.rain = self._program(shaders.RAIN_VERTEX, shaders.RAIN_FRAGMENT)
        self.corners = gl.buffer(np.array([(-1, -1), (1, -1), (-1, 1), (1, 1)], "f4").tobytes())
        self.layers = _mipmapped_array(texture_layers())
        self.drops = gl.texture((128, 128), 1, rain_drops().tobytes())
        self.drops.build_mipmaps()

    def _program(self, vertex: str, fragment: str) -> moderngl.Program:
        program = gl_context().program(vertex_shader=vertex, fragment_shader=fragment)
        for block, binding in (("Frame", 0), ("Look", 1)):
            if block in program:
                program[block].binding = binding
        for unit, sampler in enumerate(("layers", "shadows", "panorama", "drops")):
            if sampler in program:
                program[sampler] = unit
        return program


@lru_cache(maxsize=1)
def programs() -> Programs:
    """The process's programs, compiled at the first call."""
    return Programs()


def _mipmapped_array(layers: NDArray[np.uint8]) -> moderngl.TextureArray:
    n, height, width, channels = layers.shape
    texture = gl_context().texture_array((width, height, n), channels, layers.tobytes())
    texture.build_mipmaps()
    texture.filter = moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR
    return texture


def smooth_texture(picture: NDArray[np.uint8], wraps: bool = False) -> moderngl.Texture:
    """A picture (H, W, channels) as a texture; wraps: whether its left and right edges meet."""
    height, width, channels = picture.shape
    texture = gl_context().texture((width, height), channels, np.ascontiguousarray(picture).tobytes(), alignment=1)
    texture.repeat_x, texture.repeat_y = wraps, False
    texture.filter = moderngl.LINEAR, moderngl.LINEAR
    return texture


def rain_drops() -> NDArray[np.uint8]:
    """Streaks of rain (128, 128) that repeat at the edges."""
    rng = np.random.default_rng(7)
    picture = np.zeros((128, 128))
    for x, y, length in zip(rng.integers(128, size=70), rng.integers(128, size=70), rng.integers(10, 26, 70), strict=True):
        rows = (y + np.arange(length)) % 128
        picture[rows, x] = np.maximum(picture[rows, x], np.linspace(0.3, 1.0, length))
        picture[rows, (x + 1) % 128] = np.maximum(picture[rows, (x + 1) % 128], np.linspace(0.1, 0.4, length))
    return np.asarray(picture * 255, dtype=np.uint8)


class Target:
    """A picture to draw into, antialiased, and how it is read back."""

    def __init__(self, width: int, height: int) -> None:
        gl = gl_context()
        size = (width, height)
        self.drawn = gl.framebuffer(gl.renderbuffer(size, 4, samples=SAMPLES), gl.depth_renderbuffer(size, samples=SAMPLES))
        self.resolved = gl.framebuffer(gl.renderbuffer(size, 4)) if SAMPLES else self.drawn
        self.bytes = np.zeros((height, width, 4), np.uint8)

    def read(self) -> NDArray[np.uint8]:
        """The picture (H, W, 3); pictures are drawn upside down, so the first row read is the top one."""
        if SAMPLES:
            gl_context().copy_framebuffer(self.resolved, self.drawn)
        self.resolved.read_into(self.bytes, components=4)
        return np.ascontiguousarray(self.bytes[..., :3])

    def release(self) -> None:
        self.drawn.release()
        if SAMPLES:
            self.resolved.release()
