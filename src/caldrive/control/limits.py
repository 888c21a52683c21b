"""What a controller's constants may be: numbers with which its laws can reckon, and that mean something on a road."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from caldrive.control.controller import ControlConfig

USUAL = (0.0, 1e4)
LIMITS: Mapping[str, tuple[float, float]] = {  # of those that are not as usual, from and to, by their last name
    "initial_limit": (1.0, 200.0),
    "cap": (1.0, 200.0),
    "turn_speed": (0.0, math.inf),  # the paper has no such limit
    "follow_d": (-1e4, 1e4),
    **dict.fromkeys(("low", "high"), (-1.0, 1.0)),
    **dict.fromkeys(("blind_brake", "red_floor", "hold_brake", "red_threshold", "hazard_threshold"), (0.0, 1.0)),
    "speed_floor": (0.01, 100.0),  # the steering law divides by it
    "max_angle": (0.01, math.pi / 2),
}


def require_constants(config: ControlConfig, where: str) -> None:
    """Raises ValueError for a constant that cannot be. where: the file that it comes from."""
    for name, value in _numbers(asdict(config)):
        low, high = LIMITS.get(name.rpartition(".")[2], USUAL)
        if not low <= value <= high:
            wanted = f"{low:g} or more" if high == math.inf else f"{low:g} to {high:g}"
            raise ValueError(f"found {name} = {value} in {where}, wanted {wanted}: change it")


def _numbers(values: Mapping[str, Any], place: str = "") -> Iterator[tuple[str, float]]:
    """All numbers in nested dictionaries, by names as `longitudinal.cruise.kp`."""
    for name, value in values.items():
        if isinstance(value, dict):
            yield from _numbers(value, f"{place}{name}.")
        elif value is not None and not isinstance(value, bool):
            yield from ((f"{place}{name}", number) for number in (value if isinstance(value, tuple) else (value,)))
