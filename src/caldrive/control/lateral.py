"""Affordances to steering: the Stanley law with damping (section 3.2, eq. 2 and 3).

1. Turn the front wheels to where the route heads, and towards the centre line as far as the distance and speed ask.
2. Damp against the angle of the step before, which reduces swaying on straight roads.
3. Divide by the largest wheel angle.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from caldrive.control.pid import clip
from caldrive.datatypes import Affordances, Command


@dataclass(frozen=True)
class LateralConfig:
    """Constants of the Stanley law."""

    left: tuple[float, float] = (0.5, 0.05)
    """Gain in 1/s, and damping, where the command is left."""
    right: tuple[float, float] = (1.0, 0.075)
    """The same for right."""
    straight: tuple[float, float] = (1.0, 0.1)
    """The same for straight."""
    speed_floor: float = 2.0
    """m/s, the least speed that the law divides by."""
    max_angle: float = 0.6109
    """rad, the largest angle of the front wheels (35°)."""


def stanley_angle(relative_angle: float, center_distance: float, speed: float, gain: float, floor: float) -> float:
    """δ_SC = ψ + arctan(k d / v) in rad, + to the left; speed in m/s, gain k in 1/s.

    The speed is at least `floor`: near standstill k d / v grows without bound and would throw the wheels to the stop
    for a few centimetres.
    """
    return relative_angle + math.atan(gain * center_distance / max(speed, floor))


def damped(angle: float, last_angle: float, damping: float) -> float:
    """δ(t) = δ_SC - D (δ_SC - δ(t-1)), all in rad."""
    return angle - damping * (angle - last_angle)


def steer_angle(
    affordances: Affordances, speed: float, command: Command, last_angle: float, config: LateralConfig
) -> float:
    """The front wheels' angle in rad within ±config.max_angle, + to the left; speed in m/s."""
    gain, damping = getattr(config, command.value)
    angle = stanley_angle(affordances.relative_angle, affordances.center_distance, speed, gain, config.speed_floor)
    return clip(damped(angle, last_angle, damping), -config.max_angle, config.max_angle)
