"""How a town is decorated: what lines its streets, what it is built of, and how the sun stands to it.

`TOWNS` has the two towns' own decors; `redecoration.py` makes up any number of others.
"""

from __future__ import annotations

from dataclasses import dataclass

from caldrive.world.scene.meshes import RGB
from caldrive.world.scene.textures import Tex

N_VARIANTS = 4  # of each kind of street furniture
Color = tuple[float, float, float]  # shares of full brightness
Profile = tuple[tuple[float, float], ...]  # (radius, height) in m from the foot upwards


@dataclass(frozen=True)
class Style:
    """What lines the streets. frontage, depth, tree_gap, tree_height: least and most metres. gap: share of plots."""

    frontage: tuple[float, float]
    depth: tuple[float, float]
    floors: tuple[int, int]
    floor: float
    gap: float
    tree_gap: tuple[float, float]
    tree_height: tuple[float, float]
    in_gaps: tuple[str, ...]


@dataclass(frozen=True)
class Paint:
    """Colours of centre lines, edge lines and asphalt. stripes: half widths of the two lines, inset of the edge line in
    m, share of a dash."""

    center: Color
    edge: Color
    asphalt: Color
    stripes: tuple[float, float, float, float]


@dataclass(frozen=True)
class Ground:
    """Colours and layers of the ground: (layer, tint, metres of one tile). dash: metres of one dash and one gap."""

    dash: float
    kerb: RGB
    pavement: tuple[Tex, RGB, float]
    yard: tuple[Tex, RGB, float]


@dataclass(frozen=True)
class Design:
    """One type of building: layers of the upper floors and the ground floor, tints, and the roof's rise in metres."""

    upper: Tex
    ground: Tex
    tint: RGB
    base: RGB
    roof: Tex
    roof_tint: RGB
    rise: float


@dataclass(frozen=True)
class Crown:
    """One type of tree: outline, colour and layer of the crown, colour of the trunk."""

    profile: Profile
    color: RGB
    layer: Tex
    bark: RGB


@dataclass(frozen=True)
class Oddment:
    """A box of no particular kind. length (towards the road), width and height in m."""

    length: float
    width: float
    height: float
    color: RGB
    layer: Tex


@dataclass(frozen=True)
class Furniture:
    """Colours of street furniture, and what else stands at the back of sidewalks (oddments) and between houses (shed).

    hues: of boxes and containers. gap: least and most metres between small things on a sidewalk.
    """

    hues: tuple[RGB, ...] = ((168, 60, 48), (52, 92, 140), (214, 170, 62), (74, 124, 82))
    bench: RGB = (138, 96, 62)
    bin: RGB = (66, 92, 72)
    hydrant: RGB = (196, 44, 36)
    gap: tuple[float, float] = (14, 40)
    oddments: tuple[Oddment, ...] = ()
    shed: Oddment | None = None

    def oddment(self, kind: str, variant: int) -> Oddment | None:
        """The box that a kind of prop is; None for one that has a form of its own."""
        if kind == "oddment":
            return self.oddments[variant]
        return self.shed if kind == "shed" else None


@dataclass(frozen=True)
class Decor:
    """All of it. sun: azimuth in rad. arm: length in m of a street lamp's arm, 0 for a lantern on its post."""

    style: Style
    paint: Paint
    ground: Ground
    designs: tuple[Design, ...]
    crowns: tuple[Crown, ...]
    fence: RGB
    sun: float
    arm: float
    furniture: Furniture = Furniture()


_BARK, _DARK = (104, 84, 66), (84, 66, 54)

TOWNS = {
    "town01": Decor(
        Style((9, 16), (9, 12), (2, 4), 3.1, 0.15, (9, 20), (5.0, 7.5), ("hedge", "hedge", "billboard", "fence")),
        Paint((0.93, 0.70, 0.20), (0.92, 0.92, 0.90), (0.50, 0.50, 0.51), (0.10, 0.075, 0.28, 0.5)),
        Ground(6.0, (204, 202, 196), (Tex.SLABS, (214, 212, 208), 2.4), (Tex.GRASS, (235, 240, 225), 7.0)),
        (
            Design(Tex.SASH, Tex.HALL, (244, 222, 170), (226, 214, 196), Tex.TILES, (196, 96, 70), 2.6),
            Design(Tex.PANE, Tex.SHOP, (236, 190, 164), (240, 226, 214), Tex.TILES, (176, 84, 64), 2.2),
            Design(Tex.BALCONY, Tex.SHOP, (240, 236, 226), (230, 226, 222), Tex.TILES, (150, 78, 62), 2.4),
            Design(Tex.SASH, Tex.SHOP, (206, 218, 206), (226, 230, 222), Tex.TILES, (120, 92, 84), 2.8),
            Design(Tex.PANE, Tex.HALL, (214, 168, 140), (206, 196, 184), Tex.TILES, (188, 92, 66), 3.0),
            Design(Tex.BALCONY, Tex.HALL, (190, 206, 222), (218, 218, 218), Tex.TILES, (132, 76, 66), 2.2),
        ),
        (
            Crown(((0.3, 2.3), (1.5, 3.1), (1.75, 4.3), (1.1, 5.5), (0.0, 6.0)), (98, 142, 62), Tex.LEAVES, _BARK),
            Crown(
                ((0.4, 2.5), (1.2, 3.0), (1.55, 4.0), (1.2, 5.2), (0.0, 5.9)), (126, 158, 70), Tex.LEAVES,
                (112, 94, 76),
            ),
            Crown(((0.2, 1.9), (0.75, 2.7), (0.95, 4.0), (0.6, 5.4), (0.0, 6.2)), (82, 126, 64), Tex.LEAVES, _BARK),
        ),
        fence=(206, 196, 176), sun=0.95, arm=0.0,
    ),
    "town02": Decor(
        Style((12, 24), (10, 14), (2, 6), 3.4, 0.25, (12, 28), (6.0, 9.0), ("fence", "container", "billboard", "wall")),
        Paint((0.95, 0.82, 0.42), (0.88, 0.88, 0.86), (0.58, 0.56, 0.54), (0.09, 0.06, 0.18, 0.42)),
        Ground(4.5, (178, 172, 168), (Tex.BRICKS, (200, 148, 128), 1.6), (Tex.GRAVEL, (235, 230, 220), 9.0)),
        (
            Design(Tex.GLASS, Tex.LOBBY, (226, 240, 250), (236, 240, 244), Tex.PLAIN, (132, 134, 138), 0.0),
            Design(Tex.BAND, Tex.LOBBY, (214, 212, 206), (232, 232, 232), Tex.PLAIN, (120, 120, 122), 0.0),
            Design(Tex.LOFT, Tex.DOCK, (178, 104, 84), (206, 190, 180), Tex.PLAIN, (110, 100, 96), 0.0),
            Design(Tex.BAND, Tex.DOCK, (160, 172, 178), (214, 214, 212), Tex.PLAIN, (96, 100, 104), 0.0),
            Design(Tex.LOFT, Tex.LOBBY, (148, 128, 118), (214, 210, 206), Tex.PLAIN, (92, 90, 90), 0.0),
            Design(Tex.GLASS, Tex.DOCK, (206, 216, 206), (200, 204, 200), Tex.PLAIN, (128, 130, 128), 0.0),
        ),
        (
            Crown(((0.2, 1.5), (1.35, 1.9), (0.95, 3.4), (0.5, 4.8), (0.0, 6.0)), (58, 98, 78), Tex.NEEDLES, _DARK),
            Crown(((0.2, 1.2), (1.0, 1.7), (0.75, 3.4), (0.4, 5.0), (0.0, 6.2)), (70, 110, 80), Tex.NEEDLES, _DARK),
            Crown(
                ((0.3, 2.6), (1.2, 3.1), (1.4, 4.2), (0.9, 5.3), (0.0, 5.8)), (206, 142, 58), Tex.LEAVES,
                (196, 190, 180),
            ),
        ),
        fence=(120, 124, 128), sun=2.5, arm=0.9,
    ),
}  # fmt: skip
