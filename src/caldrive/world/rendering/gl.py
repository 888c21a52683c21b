"""OpenGL without a display: the process's one context, its textures, and the targets that pictures are drawn into."""

from __future__ import annotations

from functools import lru_cache

import moderngl
import numpy as np
from numpy.typing import NDArray
from PIL import Image

DROPS = 128  # texels of the rain's texture along each side


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


def mipmapped_layers(layers: NDArray[np.uint8]) -> moderngl.TextureArray:
    """Pictures (N, H, W, channels) as one texture array with mipmaps."""
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


def rain_texture() -> moderngl.Texture:
    """Streaks of rain as a texture that repeats at its edges."""
    return gl_context().texture((DROPS, DROPS), 1, rain_streaks().tobytes())


def rain_streaks() -> NDArray[np.uint8]:
    """Streaks of rain (DROPS, DROPS) that repeat at the edges, each two texels wide."""
    rng = np.random.default_rng(7)
    picture = np.zeros((DROPS, DROPS))
    for x, y, length in zip(
        rng.integers(DROPS, size=70), rng.integers(DROPS, size=70), rng.integers(10, 26, 70), strict=True
    ):
        rows = (y + np.arange(length)) % DROPS
        picture[rows, x] = np.maximum(picture[rows, x], np.linspace(0.3, 1.0, length))
        beside = (x + 1) % DROPS
        picture[rows, beside] = np.maximum(picture[rows, beside], np.linspace(0.1, 0.4, length))
    return np.asarray(picture * 255, dtype=np.uint8)


class RenderTarget:
    """A picture of size (width, height) in pixels to draw into and to read back. supersampling: it is drawn so many
    times as wide and as high, and the mean of supersampling² pixels gives one, as a real lens does."""

    def __init__(self, size: tuple[int, int], supersampling: int = 1) -> None:
        gl = gl_context()
        self.supersampling = supersampling
        self.size = (size[0] * supersampling, size[1] * supersampling)
        self.framebuffer = gl.framebuffer(gl.renderbuffer(self.size, 4), gl.depth_renderbuffer(self.size))

    def read(self) -> NDArray[np.uint8]:
        """The picture (H, W, 3); pictures are drawn upside down, so the first row read is the top one."""
        picture = np.empty((self.size[1], self.size[0], 3), np.uint8)
        self.framebuffer.read_into(picture, components=3, alignment=1)
        if self.supersampling == 1:
            return picture
        return np.array(Image.fromarray(picture).reduce(self.supersampling))
