"""What a recording holds: one dataclass for Python, the command line and TOML files."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class CollectConfig:
    """Record episodes that the oracle drives; what is there already is kept."""

    town: str = "town01"
    """town01 for training, or a generated town such as random:7; town02 is for evaluation only, and so are generated
    towns with seeds from 9,000,000 on."""
    weathers: tuple[int, ...] = (1, 8, 3, 1, 8, 6)
    """The weathers, in turn. Clear noon has the hardest shadows, and at clear sunset most is lost at junctions: both
    come twice as often."""
    episodes: int = 1800
    """How many episodes the folder holds in the end."""
    duration: float = 12.0
    """Simulated seconds of each. Short, because a new place and a new look teach most. While the car stands for long,
    one frame in fifteen is kept."""
    cars: int = 75
    """Other cars in half of the episodes. Tailgating episodes have twice as many, the rest a third."""
    people: int = 70
    """Pedestrians."""
    crossing: float = 0.64
    """How many times as often as usual pedestrians cross the road: while a network is tested they do so more often
    (section 4)."""
    before_signs: float = 0.35
    """Share of the episodes that begin shortly before a speed sign (not the tailgating ones)."""
    before_turns: float = 0.5
    """Share of the episodes that begin shortly before a turn at a junction (not the tailgating ones)."""
    displaced: float = 0.3
    """Share of the episodes that begin beside the middle of the lane or turned away from it."""
    randomised: float = 0.85
    """Share of the episodes in which the town looks different: other houses, trees, colours and sun along the same
    streets (domain randomisation)."""
    hidden_cars: float = 0.1
    """Share of the episodes without tailgating in which no car ahead is reported to the driver, who then has to make a
    hazard stop."""
    tailgating: float = 0.2
    """Share of the episodes in which the driver looks for cars and stops close behind them, at 20 km/h at most and for
    up to six times the duration."""
    width: int = 200
    """Width of the images in pixels; the preset paper takes 320."""
    height: int = 88
    """Height of the images in pixels; the preset paper takes 144."""
    semantic: bool = False
    """Also record the class of each pixel (datatypes.Semantic)."""
    seed: int = 0
    """Decides everything random."""
