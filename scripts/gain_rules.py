"""Prints the table of docs/tuning.md: the controller with the gains of each of Ziegler's and Nichols' rules.

python -m scripts.gain_rules
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from caldrive.control.controller import ControlConfig
from caldrive.control.presets import controller_config
from caldrive.datatypes import DT
from caldrive.formats import markdown_table
from caldrive.tune.maneuvers import MANEUVERS, drive
from caldrive.tune.ziegler_nichols import RULES, Ultimate, find_ultimate, proposed, speed_response

HEADS = (
    "gains of both PIDs", "highest speed at a limit of 60", "RMS jerk", "throttle's movement",
    "RMS jerk behind the car",
)  # fmt: skip


def controllers(ultimate: Ultimate) -> Iterator[tuple[str, ControlConfig]]:
    """The default, the same with each rule's gains, and the paper's."""
    default = ControlConfig()
    yield "default", default
    for rule in RULES:
        law = default.longitudinal
        cruise, follow = (proposed(rule, ultimate, gains) for gains in (law.cruise, law.follow))
        yield rule, replace(default, longitudinal=replace(law, cruise=cruise, follow=follow))
    yield "the paper's controller, all constants", controller_config("paper", None)


def row(name: str, config: ControlConfig) -> list[str]:
    """What a controller does in two of the maneuvers."""
    speed, follow = (drive(MANEUVERS[maneuver], config).signals for maneuver in ("speed", "follow"))
    moved = float(np.abs(np.diff(speed.throttle)).mean()) / DT
    jerks = [float(np.sqrt(np.mean(one.jerk**2))) for one in (speed, follow)]
    return [
        name, f"{speed.speed.max():.1f} km/h", f"{jerks[0]:.1f} m/s³", f"{moved:.2f} / s", f"{jerks[1]:.1f} m/s³",
    ]  # fmt: skip


def main() -> int:
    ultimate = find_ultimate(speed_response, DT)
    print(f"K_u is {ultimate.gain:.2f} per km/h and T_u {ultimate.period:.2f} s\n")
    print(markdown_table(HEADS, [row(name, config) for name, config in controllers(ultimate)]))
    return 0


if __name__ == "__main__":
    sys.exit(main())
