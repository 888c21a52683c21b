"""Settings of a search for a controller's constants, with their limits. No import here waits for NumPy or Optuna."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any, Literal, get_args

from caldrive.checks import MOST_SEED, Limits, require_limits

ManeuverName = Literal["speed", "light", "follow", "bend", "left", "right"]
MANEUVER_NAMES: tuple[ManeuverName, ...] = get_args(ManeuverName)
# Those that a search may change: what decides how the car moves. Thresholds of probabilities are not among them, as
# the oracle's are 0 or 1, nor what stands for law, such as the margin over the limit.
SEARCHED = (
    *(f"longitudinal.{state}.{gain}" for state in ("cruise", "follow") for gain in ("kp", "ki", "kd")),
    *(f"longitudinal.{name}" for name in ("turn_speed", "follow_c", "over_limit_gain", "red_gain")),
    *(f"lateral.{command}.{part}" for command in ("left", "right", "straight") for part in ("gain", "damping")),
)
LIMITS: Limits = {"trials": (1, 100_000), "routes": (0, 12), "seed": (0, MOST_SEED)}
FREE = ("trials",)  # settings that may change while a search is under way: no trial depends on them
MOST_WEIGHT = 1e6


@dataclass(frozen=True)
class CostWeights:
    """How much each part of a drive's cost counts; `tune/cost.py` has their units."""

    time: float = 1.0
    """Weight of the share of the time limit that the drive takes."""
    jerk: float = 1.0
    """Weight of the RMS jerk, in units of nuPlan's bound of 8.37 m/s³."""
    center: float = 1.0
    """Weight of the mean distance to the centre line, in units of the paper's 0.334 m."""
    infraction: float = 1.0
    """Weight of each infraction, and of a goal that is not reached."""

    def __post_init__(self) -> None:
        usual = {field.name: field.default for field in fields(self)}
        require_limits(vars(self), dict.fromkeys(usual, (0.0, MOST_WEIGHT)), usual, "cost")
        if not any(vars(self).values()):
            raise ValueError("found a weight of 0 for every part of the cost, wanted one above it: type --cost.time 1")


@dataclass(frozen=True)
class TuneConfig:
    """A search for the controller's constants with the least cost."""

    trials: int = 100
    """With --auto: controllers that are tried. More of them go on with a search that is finished."""
    maneuvers: tuple[ManeuverName, ...] = MANEUVER_NAMES
    """With --auto: what is driven on a single road."""
    routes: int = 2
    """With --auto: routes of town01 that are driven among cars and people. As many others judge the result."""
    constants: tuple[str, ...] = SEARCHED
    """With --auto: the constants that are searched, some of those that are listed here."""
    cost: CostWeights = CostWeights()
    """With --auto: what a drive costs."""
    seed: int = 0
    """With --auto: decides everything random."""

    def __post_init__(self) -> None:
        usual = {field.name: field.default for field in fields(self)}
        require_limits(vars(self), LIMITS, usual)
        for option, given, known in (
            ("--maneuvers", self.maneuvers, MANEUVER_NAMES), ("--constants", self.constants, SEARCHED),
        ):  # fmt: skip
            unknown = [name for name in given if name not in known]
            if unknown or len(set(given)) < len(given):
                found = unknown[0] if unknown else " ".join(given)
                raise ValueError(f"found {option} {found}, wanted some of {', '.join(known)}: type {option} {known[0]}")
        if not self.constants or not (self.maneuvers or self.routes):
            raise ValueError("found nothing to search or to drive, wanted both: leave --constants and --maneuvers out")

    def decisive(self) -> dict[str, Any]:
        """The settings on which a trial depends, in JSON's types."""
        values = {name: value for name, value in vars(self).items() if name not in FREE}
        return values | {
            "maneuvers": list(self.maneuvers), "constants": list(self.constants), "cost": vars(self.cost),
        }  # fmt: skip
