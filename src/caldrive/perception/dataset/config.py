"""Settings of what happens to the images of a training: augmentation, and other colours for each class of things."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields

from caldrive.checks import require_limits

SHARES = ("share", "rare_share", "plain", "noise")  # from 0 to 1; the other numbers are 0 or more


@dataclass(frozen=True)
class AugmentationConfig:
    """Augmentation of whole images (section 3.1). The frames of one window change alike."""

    enabled: bool = True
    """Augment images; False leaves them as they are."""
    share: float = 0.5
    """Share of the windows to which each change of colour and light is applied."""
    rare_share: float = 0.2
    """Share of the windows to which blur, and noise, are applied."""
    color: float = 0.25
    """Largest change of a colour channel's factor."""
    saturation: float = 0.8
    """Largest change of the saturation's factor."""
    contrast: float = 0.4
    """Largest change of the contrast's factor."""
    brightness: float = 0.25
    """Largest shift of the brightness, as a share of full brightness."""
    blur: float = 1.2
    """Largest standard deviation of the Gaussian blur, in pixels."""
    noise: float = 0.03
    """Largest share of pixels that become salt or pepper."""

    def __post_init__(self) -> None:
        _check(self, "augmentation")


@dataclass(frozen=True)
class RecolourConfig:
    """Other colours for each class of things, where the recording has semantic images (domain randomisation)."""

    enabled: bool = True
    """Recolour images; False leaves them as they are."""
    share: float = 0.5
    """Share of the windows that are recoloured."""
    tint: float = 0.35
    """Largest change of a colour channel's factor."""
    light: float = 0.5
    """Largest change of a class's brightness, as the logarithm of a factor."""
    plain: float = 0.8
    """Largest share of one single colour in a class."""
    grain: float = 0.12
    """Largest standard deviation of the noise on a class, as a share of its brightness."""
    patches: int = 12
    """Most rectangles of any colour beside the road; half the image's height and a quarter of its width at most."""
    shadows: int = 3
    """Most shadows of houses that are not in the image, or gaps of light between them."""

    def __post_init__(self) -> None:
        _check(self, "recolour")


def _check(config: AugmentationConfig | RecolourConfig, option: str) -> None:
    """Raises ValueError for a number that cannot be."""
    limits = {field.name: (0, 1.0 if field.name in SHARES else math.inf) for field in fields(config)}
    require_limits(vars(config), limits, vars(type(config)), option)
