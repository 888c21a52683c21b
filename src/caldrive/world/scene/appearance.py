"""What makes up the appearance of a town: what lines its streets, what it is built of, how the sun stands to it.

`town_appearances` has those of the two towns, `domain_randomisation` makes any number of others. An appearance's number
is 0 for a town's own.
"""

from __future__ import annotations

from dataclasses import dataclass

from caldrive.world.scene.meshes import RGB, Surface
from caldrive.world.scene.textures import Tex

N_VARIANTS = 4  # of each kind of street furniture
N_BUILDING_TYPES = 6
Color = tuple[float, float, float]  # shares of full brightness
Range = tuple[float, float]  # least and most
Profile = tuple[tuple[float, float], ...]  # (radius, height) in m from the foot upwards


@dataclass(frozen=True)
class StreetLayout:
    """How plots and trees lie along the streets. Ranges are the least and the most metres."""

    frontage: Range
    """Width of a plot along the street."""
    depth: Range
    """Depth of a house."""
    floors: tuple[int, int]
    """Least and most floors of a house."""
    floor_height: float
    """m."""
    gap_share: float
    """Share of the plots without a house."""
    tree_spacing: Range
    """From one tree to the next."""
    tree_height: Range
    """With the crown."""
    in_gaps: tuple[str, ...]
    """Kinds of props that stand on plots without a house, each as likely."""


@dataclass(frozen=True)
class RoadPaint:
    """Colours of asphalt and markings, and the widths of these."""

    center: Color
    """Of centre lines."""
    edge: Color
    """Of edge lines, dividers and stop lines."""
    asphalt: Color
    """Of the road."""
    center_half_width: float
    """m, of a centre line."""
    edge_half_width: float
    """m, of an edge line."""
    edge_inset: float
    """m from the road's edge to the middle of an edge line."""
    dash_share: float
    """Share of a broken line that is painted."""

    @property
    def widths(self) -> tuple[float, float, float, float]:
        """As the road's shader takes them."""
        return self.center_half_width, self.edge_half_width, self.edge_inset, self.dash_share


@dataclass(frozen=True)
class GroundCover:
    """What the ground is covered with."""

    dash: float
    """m of one dash and one gap of a centre line."""
    kerb: RGB
    """Colour of the kerbs."""
    pavement: Surface
    """Of the sidewalks."""
    yard: Surface
    """Of the ground behind them."""


@dataclass(frozen=True)
class BuildingType:
    """One type of building: layers of the texture array and colours that tint them."""

    upper: Tex
    """Upper floors."""
    ground: Tex
    """Ground floor."""
    tint: RGB
    """Of the upper floors."""
    base: RGB
    """Tint of the ground floor."""
    roof: Tex
    """Layer of the roof."""
    roof_tint: RGB
    """Of the roof."""
    rise: float
    """m from the eaves to the ridge, 0 for a flat roof."""


@dataclass(frozen=True)
class TreeType:
    """One type of tree, drawn with a height of 6 m."""

    profile: Profile
    """Outline of the crown."""
    color: RGB
    """Of the crown."""
    layer: Tex
    """Of the crown."""
    bark: RGB
    """Colour of the trunk."""


@dataclass(frozen=True)
class Distractor:
    """A box of no particular kind, as domain randomisation puts them beside streets. In m: length (towards the road),
    width, height."""

    length: float
    width: float
    height: float
    surface: Surface


@dataclass(frozen=True)
class StreetFurniture:
    """Colours of street furniture, how densely it stands, and distractors."""

    hues: tuple[RGB, ...] = ((168, 60, 48), (52, 92, 140), (214, 170, 62), (74, 124, 82))
    """Of boxes and containers."""
    bench: RGB = (138, 96, 62)
    """Colour of benches."""
    bin: RGB = (66, 92, 72)
    """Colour of bins."""
    hydrant: RGB = (196, 44, 36)
    """Colour of hydrants."""
    spacing: Range = (14, 40)
    """m from one small thing on a sidewalk to the next."""
    distractors: tuple[Distractor, ...] = ()
    """At the back of the sidewalks."""
    shed: Distractor | None = None
    """Between houses."""

    def distractor(self, kind: str, variant: int) -> Distractor | None:
        """The box that a kind of prop is; None for one that has a form of its own."""
        if kind == "distractor":
            return self.distractors[variant]
        return self.shed if kind == "shed" else None


@dataclass(frozen=True)
class Appearance:
    """All that makes the same streets look like one town or another."""

    layout: StreetLayout
    paint: RoadPaint
    ground: GroundCover
    buildings: tuple[BuildingType, ...]
    """N_BUILDING_TYPES of them."""
    trees: tuple[TreeType, ...]
    """Three of them."""
    fence: RGB
    """Colour of fences."""
    sun_azimuth: float
    """rad, counter-clockwise from the x axis."""
    lamp_arm: float
    """m, length of a street lamp's arm; 0 for a lantern on its post."""
    furniture: StreetFurniture = StreetFurniture()
    number: int = 0
    """Which random appearance it is; 0 for a town's own."""
