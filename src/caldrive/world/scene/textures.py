"""The texture array: all surfaces, façades and signs, drawn once in a process from a fixed seed."""

from __future__ import annotations

from enum import IntEnum

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from caldrive.world.scene import facades
from caldrive.world.scene.meshes import RGB
from caldrive.world.scene.patterns import SIZE, Layer, asphalt, flipped, leaves, paving, speckled


class Tex(IntEnum):
    """Layers of the array."""

    PLAIN = 0
    ASPHALT = 1
    SLABS = 2
    BRICKS = 3
    GRASS = 4
    GRAVEL = 5
    LEAVES = 6
    NEEDLES = 7
    TILES = 8
    SASH = 9  # town01: tall windows with shutters
    PANE = 10  # town01: small cross-barred windows
    BALCONY = 11  # town01: windows with balconies
    SHOP = 12  # town01: ground floor with shop windows
    HALL = 13  # town01: ground floor with doors
    GLASS = 14  # town02: curtain wall
    BAND = 15  # town02: ribbon windows
    LOFT = 16  # town02: brick with factory windows
    LOBBY = 17  # town02: glazed ground floor
    DOCK = 18  # town02: ground floor with gates
    SIGN_30 = 19
    SIGN_60 = 20
    SIGN_90 = 21
    POSTER_A = 22
    POSTER_B = 23
    PLATES = 24
    SETTS = 25
    PLANKS = 26
    CONCRETE = 27
    INVENTED_A = 28  # façades of nowhere, for domain randomisation
    INVENTED_B = 29
    INVENTED_C = 30
    INVENTED_D = 31
    INVENTED_E = 32
    INVENTED_F = 33


SIGN_LAYERS = {30: Tex.SIGN_30, 60: Tex.SIGN_60, 90: Tex.SIGN_90}
_FACADES = {
    Tex.SASH: facades.sash,
    Tex.PANE: facades.pane,
    Tex.BALCONY: facades.balcony,
    Tex.SHOP: facades.shop,
    Tex.HALL: facades.hall,
    Tex.GLASS: facades.glass,
    Tex.BAND: facades.band,
    Tex.LOFT: facades.loft,
    Tex.LOBBY: facades.lobby,
    Tex.DOCK: facades.dock,
}


def _sign(limit: int) -> Layer:
    """A round sign: white, a red ring, the limit in bold digits as wide as the white allows."""
    big = 4 * SIZE  # drawn large and shrunk, for smooth edges
    picture = Image.new("RGB", (big, big), (192, 20, 28))
    draw = ImageDraw.Draw(picture)
    rim = int(0.105 * big)
    draw.ellipse((rim, rim, big - rim, big - rim), fill=(250, 250, 248))
    font = ImageFont.load_default(int(0.60 * big))
    ink = (8, 8, 10)
    draw.text((big / 2, big / 2), str(limit), ink, font, anchor="mm", stroke_width=big // 36, stroke_fill=ink)
    return flipped(picture.resize((SIZE, SIZE), Image.Resampling.BOX))


def _poster(ground: RGB, mark: RGB, word: str) -> Layer:
    """A disc over a word, both of one colour."""
    picture = Image.new("RGB", (SIZE, SIZE), ground)
    draw = ImageDraw.Draw(picture)
    draw.ellipse((SIZE * 0.3, SIZE * 0.08, SIZE * 0.7, SIZE * 0.48), fill=mark)
    draw.text((SIZE / 2, SIZE * 0.72), word, mark, ImageFont.load_default(SIZE // 4), anchor="mm", stroke_width=1)
    return flipped(picture)


def texture_layers() -> NDArray[np.uint8]:
    """All layers (34, SIZE, SIZE, 3), bottom row first, in the order of `Tex`."""
    rng = np.random.default_rng(20180614)
    layers = {  # the order of the rows is the order of the random numbers
        Tex.PLAIN: np.full((SIZE, SIZE, 3), 255, np.uint8),
        Tex.ASPHALT: asphalt(rng),
        Tex.SLABS: paving((196, 192, 186), joint=0.72, rows=4, columns=4, rng=rng),
        Tex.BRICKS: paving((208, 196, 190), joint=0.74, rows=12, columns=6, rng=rng),
        Tex.GRASS: leaves((112, 138, 74), rng, cells=8),
        Tex.GRAVEL: speckled((176, 162, 136), rng, fine=0.14, coarse=0.10, cells=8),
        Tex.LEAVES: leaves((226, 232, 214), rng, cells=10),
        Tex.NEEDLES: leaves((214, 222, 214), rng, cells=20),
        Tex.TILES: paving((214, 206, 202), joint=0.66, rows=12, columns=8, rng=rng),
        **{layer: draw(rng) for layer, draw in _FACADES.items()},
        **{layer: _sign(limit) for limit, layer in SIGN_LAYERS.items()},
        Tex.POSTER_A: _poster(ground=(222, 176, 58), mark=(60, 44, 40), word="JAZZ"),
        Tex.POSTER_B: _poster(ground=(58, 110, 128), mark=(238, 236, 220), word="EXPO"),
        Tex.PLATES: paving((214, 212, 208), joint=0.8, rows=2, columns=2, rng=rng),
        Tex.SETTS: paving((206, 204, 200), joint=0.6, rows=10, columns=10, rng=rng),
        Tex.PLANKS: paving((212, 206, 198), joint=0.7, rows=12, columns=1, rng=rng),
        Tex.CONCRETE: speckled((206, 204, 202), rng, fine=0.05, coarse=0.16, cells=4),
        **{layer: facades.invented(rng) for layer in Tex if layer.name.startswith("INVENTED")},
    }
    return np.stack([layers[tex] for tex in Tex])
