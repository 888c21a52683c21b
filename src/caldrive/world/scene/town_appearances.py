"""The appearances of the two towns. What only `town02` is built of is in no random appearance: it is the new town."""

from __future__ import annotations

from caldrive.world.scene.appearance import Appearance, BuildingType, GroundCover, RoadPaint, StreetLayout, TreeType
from caldrive.world.scene.meshes import RGB, Surface
from caldrive.world.scene.textures import Tex


def _tiled(upper: Tex, ground: Tex, tint: RGB, base: RGB, roof_tint: RGB, rise: float) -> BuildingType:
    """A house of town01 with a hip roof of tiles."""
    return BuildingType(
        upper=upper, ground=ground, tint=tint, base=base, roof=Tex.TILES, roof_tint=roof_tint, rise=rise
    )


def _flat(upper: Tex, ground: Tex, tint: RGB, base: RGB, roof_tint: RGB) -> BuildingType:
    """A house of town02 with a flat roof."""
    return BuildingType(upper=upper, ground=ground, tint=tint, base=base, roof=Tex.PLAIN, roof_tint=roof_tint, rise=0.0)


_BARK, _DARK_BARK = (104, 84, 66), (84, 66, 54)

TOWN01 = Appearance(
    layout=StreetLayout(
        frontage=(9, 16),
        depth=(9, 12),
        floors=(2, 4),
        floor_height=3.1,
        gap_share=0.15,
        tree_spacing=(9, 20),
        tree_height=(5.0, 7.5),
        in_gaps=("hedge", "hedge", "billboard", "fence"),
    ),
    paint=RoadPaint(
        center=(0.93, 0.70, 0.20),
        edge=(0.92, 0.92, 0.90),
        asphalt=(0.50, 0.50, 0.51),
        center_half_width=0.10,
        edge_half_width=0.075,
        edge_inset=0.28,
        dash_share=0.5,
    ),
    ground=GroundCover(
        dash=6.0,
        kerb=(204, 202, 196),
        pavement=Surface((214, 212, 208), Tex.SLABS, tile=2.4),
        yard=Surface((235, 240, 225), Tex.GRASS, tile=7.0),
    ),
    buildings=(
        _tiled(Tex.SASH, Tex.HALL, tint=(244, 222, 170), base=(226, 214, 196), roof_tint=(196, 96, 70), rise=2.6),
        _tiled(Tex.PANE, Tex.SHOP, tint=(236, 190, 164), base=(240, 226, 214), roof_tint=(176, 84, 64), rise=2.2),
        _tiled(Tex.BALCONY, Tex.SHOP, tint=(240, 236, 226), base=(230, 226, 222), roof_tint=(150, 78, 62), rise=2.4),
        _tiled(Tex.SASH, Tex.SHOP, tint=(206, 218, 206), base=(226, 230, 222), roof_tint=(120, 92, 84), rise=2.8),
        _tiled(Tex.PANE, Tex.HALL, tint=(214, 168, 140), base=(206, 196, 184), roof_tint=(188, 92, 66), rise=3.0),
        _tiled(Tex.BALCONY, Tex.HALL, tint=(190, 206, 222), base=(218, 218, 218), roof_tint=(132, 76, 66), rise=2.2),
    ),
    trees=(
        TreeType(
            profile=((0.3, 2.3), (1.5, 3.1), (1.75, 4.3), (1.1, 5.5), (0.0, 6.0)),
            color=(98, 142, 62),
            layer=Tex.LEAVES,
            bark=_BARK,
        ),
        TreeType(
            profile=((0.4, 2.5), (1.2, 3.0), (1.55, 4.0), (1.2, 5.2), (0.0, 5.9)),
            color=(126, 158, 70),
            layer=Tex.LEAVES,
            bark=(112, 94, 76),
        ),
        TreeType(
            profile=((0.2, 1.9), (0.75, 2.7), (0.95, 4.0), (0.6, 5.4), (0.0, 6.2)),
            color=(82, 126, 64),
            layer=Tex.LEAVES,
            bark=_BARK,
        ),
    ),
    fence=(206, 196, 176),
    sun_azimuth=0.95,
    lamp_arm=0.0,
)

TOWN02 = Appearance(
    layout=StreetLayout(
        frontage=(12, 24),
        depth=(10, 14),
        floors=(2, 6),
        floor_height=3.4,
        gap_share=0.25,
        tree_spacing=(12, 28),
        tree_height=(6.0, 9.0),
        in_gaps=("fence", "container", "billboard", "wall"),
    ),
    paint=RoadPaint(
        center=(0.95, 0.82, 0.42),
        edge=(0.88, 0.88, 0.86),
        asphalt=(0.58, 0.56, 0.54),
        center_half_width=0.09,
        edge_half_width=0.06,
        edge_inset=0.18,
        dash_share=0.42,
    ),
    ground=GroundCover(
        dash=4.5,
        kerb=(178, 172, 168),
        pavement=Surface((200, 148, 128), Tex.BRICKS, tile=1.6),
        yard=Surface((235, 230, 220), Tex.GRAVEL, tile=9.0),
    ),
    buildings=(
        _flat(Tex.GLASS, Tex.LOBBY, tint=(226, 240, 250), base=(236, 240, 244), roof_tint=(132, 134, 138)),
        _flat(Tex.BAND, Tex.LOBBY, tint=(214, 212, 206), base=(232, 232, 232), roof_tint=(120, 120, 122)),
        _flat(Tex.LOFT, Tex.DOCK, tint=(178, 104, 84), base=(206, 190, 180), roof_tint=(110, 100, 96)),
        _flat(Tex.BAND, Tex.DOCK, tint=(160, 172, 178), base=(214, 214, 212), roof_tint=(96, 100, 104)),
        _flat(Tex.LOFT, Tex.LOBBY, tint=(148, 128, 118), base=(214, 210, 206), roof_tint=(92, 90, 90)),
        _flat(Tex.GLASS, Tex.DOCK, tint=(206, 216, 206), base=(200, 204, 200), roof_tint=(128, 130, 128)),
    ),
    trees=(
        TreeType(
            profile=((0.2, 1.5), (1.35, 1.9), (0.95, 3.4), (0.5, 4.8), (0.0, 6.0)),
            color=(58, 98, 78),
            layer=Tex.NEEDLES,
            bark=_DARK_BARK,
        ),
        TreeType(
            profile=((0.2, 1.2), (1.0, 1.7), (0.75, 3.4), (0.4, 5.0), (0.0, 6.2)),
            color=(70, 110, 80),
            layer=Tex.NEEDLES,
            bark=_DARK_BARK,
        ),
        TreeType(
            profile=((0.3, 2.6), (1.2, 3.1), (1.4, 4.2), (0.9, 5.3), (0.0, 5.8)),
            color=(206, 142, 58),
            layer=Tex.LEAVES,
            bark=(196, 190, 180),
        ),
    ),
    fence=(120, 124, 128),
    sun_azimuth=2.5,
    lamp_arm=0.9,
)

TOWN_APPEARANCES = {"town01": TOWN01, "town02": TOWN02}
