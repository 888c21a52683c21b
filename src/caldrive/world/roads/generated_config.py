"""What generated towns may be: the ranges of their settings, and the kinds of towns."""

from __future__ import annotations

from dataclasses import dataclass

Range = tuple[float, float]  # least and most


@dataclass(frozen=True)
class GeneratedTownConfig:
    """What a generated town may be. Ranges are the least and the most, all between as likely."""

    columns: tuple[int, int] = (4, 5)
    """Streets from south to north, before any is left out."""
    rows: tuple[int, int] = (3, 5)
    """Streets from west to east, before any is left out."""
    spacing: Range = (62.0, 105.0)
    """m from one of them to the next."""
    jitter: float = 8.0
    """m that a crossing lies off this grid at most, along x and along y."""
    missing: Range = (0.1, 0.3)
    """Share of the stretches between crossings that are left out. With it four-way junctions become T-junctions, and
    these become bends or parts of longer streets."""
    curved: Range = (0.0, 0.7)
    """Share of the streets without bends that curve."""
    bow: Range = (0.05, 0.12)
    """How far a curved street leaves the straight line, as a share of its length."""
    corner_radius: Range = (14.0, 30.0)
    """m, of bends; less where a bend has no room for it."""
    lane_width: Range = (3.0, 4.0)
    """m."""
    lit: Range = (1.0, 1.0)
    """Share of the junctions with lights. Below 1 whoever drives by the six affordances gets into other cars' way: none
    of them says when to yield."""
    lanes: int = 1
    """To either side. Streets that meet a roundabout have one."""
    narrow: Range = (0.0, 0.0)
    """Share of all other streets that have one lane a side. Without any, who drives in the outer lane around a town
    could leave it nowhere."""
    roundabouts: tuple[int, int] = (0, 0)
    """How many, where as many junctions have room for one."""
    ring_radius: Range = (14.0, 17.0)
    """m, of the middle of a roundabout's lane."""


CONFIGS = {  # by the kind of town
    "random": GeneratedTownConfig(),
    "random-wide": GeneratedTownConfig(
        columns=(3, 4),
        rows=(3, 4),
        spacing=(80.0, 120.0),
        missing=(0.05, 0.2),
        lane_width=(3.0, 3.2),
        lanes=2,
        narrow=(0.15, 0.4),
        roundabouts=(1, 2),
    ),
}
