"""OpenGL without a display: the process's one context, its programs and textures, and picture targets."""

from __future__ import annotations

from functools import lru_cache

import moderngl
import numpy as np
from numpy.typing import NDArray
from PIL import Image

from caldrive.world.rendering import effects, semantic_shaders, shaders
from caldrive.world.scene.textures import texture_layers


@lru_cache(maxsize=1)
def gl_context() -> moderngl.Context:
    """The process's one OpenGL context. Raises RuntimeError where the machine has no EGL."""
    try:
        context = moderngl.create_standalone_context(require=330, backend="egl")  # type: ignore[arg-type]
    except Exception as error:  # moderngl raises bare Exceptions here
        raise RuntimeError(
            f"found no EGL with OpenGL 3.3 ({error}): type apt-get install libegl1 libgl1-mesa-dri"
        ) from error
    context.gc_mode = "auto"  # what Python forgets is freed
    return context


class Programs:
    """The compiled programs with their shared blocks, and what all towns share on the graphics side."""

    def __init__(self) -> None:
        gl = gl_context()
        self.current: object = None  # whose look and textures are in place
        self.frame, self.look = gl.buffer(reserve=96, dynamic=True), gl.buffer(reserve=128, dynamic=True)
        self.static = compiled(shaders.STATIC_VERTEX, shaders.STATIC_FRAGMENT)
        self.road = compiled(shaders.ROAD_VERTEX, shaders.ROAD_FRAGMENT)
        self.actor = compiled(shaders.ACTOR_VERTEX, shaders.ACTOR_FRAGMENT)
        self.shadow = compiled(effects.SHADOW_VERTEX, effects.SHADOW_FRAGMENT)
        self.glow = compiled(effects.GLOW_VERTEX, effects.GLOW_FRAGMENT)
        self.sky = compiled(effects.SKY_VERTEX, effects.SKY_FRAGMENT)
        self.rain = compiled(effects.RAIN_VERTEX, effects.RAIN_FRAGMENT)
        self.corners = gl.buffer(np.array([(-1, -1), (1, -1), (-1, 1), (1, 1)], "f4").tobytes())
        self.layers = _mipmapped_array(texture_layers())
        self.drops = gl.texture((128, 128), 1, rain_drops().tobytes())


def compiled(vertex: str, fragment: str) -> moderngl.Program:
    """A program with its blocks and samplers where all pictures expect them."""
    program = gl_context().program(vertex_shader=vertex, fragment_shader=fragment)
    for block, binding in (("Frame", 0), ("Look", 1)):
        member = program.get(block, None)
        if isinstance(member, moderngl.UniformBlock):
            member.binding = binding
    for unit, sampler in enumerate(("layers", "shadows", "panorama", "drops")):
        if sampler in program:
            program[sampler] = unit
    return program


class SemanticPrograms:
    """The programs that draw classes instead of colours."""

    def __init__(self) -> None:
        self.road = compiled(shaders.ROAD_VERTEX, semantic_shaders.ROAD_KIND)
        self.static = compiled(semantic_shaders.STATIC_KIND_VERTEX, semantic_shaders.STATIC_KIND)
        self.actor = compiled(shaders.ACTOR_VERTEX, semantic_shaders.ACTOR_KIND)


@lru_cache(maxsize=1)
def semantic_programs() -> SemanticPrograms:
    """Those of the process, compiled at the first call."""
    return SemanticPrograms()


@lru_cache(maxsize=1)
def programs() -> Programs:
    """The process's programs, compiled at the first call."""
    return Programs()


def _mipmapped_array(layers: NDArray[np.uint8]) -> moderngl.TextureArray:
    n, height, width, channels = layers.shape
    texture = gl_context().texture_array((width, height, n), channels, layers.tobytes())
    texture.build_mipmaps()
    texture.filter = moderngl.LINEAR_MIPMAP_NEAREST, moderngl.LINEAR
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
    for x, y, length in zip(
        rng.integers(128, size=70), rng.integers(128, size=70), rng.integers(10, 26, 70), strict=True
    ):
        rows = (y + np.arange(length)) % 128
        picture[rows, x] = np.maximum(picture[rows, x], np.linspace(0.3, 1.0, length))
        picture[rows, (x + 1) % 128] = np.maximum(picture[rows, (x + 1) % 128], np.linspace(0.1, 0.4, length))
    return np.asarray(picture * 255, dtype=np.uint8)


class Target:
    """A picture (width, height) to draw into and to read back. fine: it is drawn so many times as wide and as high, and
    fine * fine pixels give one by their mean, as a lens does."""

    def __init__(self, size: tuple[int, int], fine: int = 1) -> None:
        gl = gl_context()
        self.fine = fine
        self.size = (size[0] * fine, size[1] * fine)
        self.drawn = gl.framebuffer(gl.renderbuffer(self.size, 4), gl.depth_renderbuffer(self.size))

    def read(self) -> NDArray[np.uint8]:
        """The picture (H, W, 3); pictures are drawn upside down, so the first row read is the top one."""
        picture = np.empty((self.size[1], self.size[0], 3), np.uint8)
        self.drawn.read_into(picture, components=3, alignment=1)
        return picture if self.fine == 1 else np.array(Image.fromarray(picture).reduce(self.fine))
