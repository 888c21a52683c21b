"""Controllers by name. Two presets: PAPER as printed (section 3.2, supplement 1.2), and DEFAULT, which drives better.

Where DEFAULT differs, and why:

    what                    PAPER                DEFAULT             reason
    target in turns         limit - 10 km/h      at most 15 km/h     below a cap of 20 the paper's rule creeps at 10, in
                                                                     a 60 zone it takes the turn at 50
    brake in cruising       none                 up to 0.3           holds a falling target without waiting for drag
    following from          35 m                 45 m                at 90 km/h a stop takes 44 m
    standing gap            v_max / 6            5.5 m               a car's centre enters A2 at 5.2 m from bumper to
                                                                     bumper: a queue should not be a hazard stop, and
                                                                     3 m at a limit of 20 would be
    held at standstill      by the PID           brake 0.3           below 1 km/h asked and driven: a queue does not
                                                                     creep or roll
    over limit from         15 km/h too fast     3 km/h too fast     45 in a 30 zone is not lawful
    over limit, brake       0.3 v / v*           0.03 (v - v_safe)   ends gently at the limit; heeds a car ahead, too
    red light, brake        0.2 v / 30           1.5 v / 30, >= 0.8  area A1 leaves 6.6 m to stand in; 0.2 v / 30 takes
                                                                     about 30 m from 30 km/h
    hazard stop from        0.7                  0.4                 networks are calibrated: 0.4 is what they believe,
    red light from          0.9                  0.5                 and a missed person is worse than a needless brake
    before a hazard that    stands for ever      goes on at 4 km/h   nobody takes so long to cross a road (the longest
    is no car                                    after 15 s          of 226 stops took 11 s), so it is none
    before a red light      stands for ever      twice rolls on for  99 of 100 reds are over by then in town01's dense
                                                 1.2 s, each time    traffic (386 stops), and what looks red from here
                                                 after 25 s          may not half a metre further on
    PID gains               the authors'         by step responses   less than 1 km/h too fast from 20 to 90 km/h
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from caldrive.checks import require_within
from caldrive.config import from_toml
from caldrive.control.controller import CALController, ControlConfig
from caldrive.control.limits import require_constants
from caldrive.control.longitudinal import LongitudinalConfig
from caldrive.control.patience import PatienceConfig
from caldrive.control.pid import PIDGains
from caldrive.interfaces import Controller
from caldrive.plugins import attribute, find_plugin
from caldrive.provenance import file_digest

DEFAULT = ControlConfig()

PAPER = ControlConfig(
    longitudinal=LongitudinalConfig(
        cruise=PIDGains(0.06, 0.026, 0.014, low=0.0),
        follow=PIDGains(0.16, 0.08, 0.01),
        turn_reduction=10.0,
        turn_speed=float("inf"),
        follow_distance=35.0,
        follow_d=-0.5,
        follow_gap=0.0,
        over_limit_margin=15.0,
        over_limit_ratio=0.3,
        over_limit_gain=0.0,
        red_gain=0.2,
        red_floor=0.0,
        hazard_threshold=0.7,
        red_threshold=0.9,
        hold_speed=0.0,
        hold_brake=0.0,
    ),
    patience=PatienceConfig(enabled=False),
)

PRESETS = {"default": DEFAULT, "paper": PAPER}
KNOWN = (*PRESETS, "a .toml file")


def controller_config(name: str, cap: float | None) -> ControlConfig:
    """A preset's constants, or those of a TOML file over DEFAULT (over another preset where its first line says
    preset = "paper"), with a cap in km/h.

    Raises ValueError for an unknown preset, a file that cannot be used, or a cap that cannot be.
    """
    if cap is not None:
        require_within("--cap", cap, 1.0, 200.0, 20)
    config = PRESETS[name] if name in PRESETS else from_toml(Path(name), PRESETS, DEFAULT)
    require_constants(config, name)
    return replace(config, cap=cap) if cap is not None else config


def make_controller(name: str, cap: float | None, dt: float) -> Controller:
    """A controller by name: a preset, a .toml file, `package.module:Class`, `file.py:Class` or an entry point.

    A class is given `cap` and `dt` where its maker has parameters of these names. Raises ValueError for what is none.
    """
    if name in PRESETS or name.endswith(".toml"):
        return CALController(controller_config(name, cap), dt)
    plugin = find_plugin(name, "controller", KNOWN)
    controller: Controller = plugin.build(cap=cap, dt=dt)
    if not callable(attribute(controller, "step")):
        raise ValueError(
            f"found that {plugin.name} has no method step, wanted step(affordances, speed, command) that returns a "
            "Decision: add it"
        )
    return controller


def controller_source(name: str) -> str | None:
    """A digest of the file that a controller's constants or code come from; None for a preset."""
    if name in PRESETS:
        return None
    return file_digest(Path(name)) if name.endswith(".toml") else find_plugin(name, "controller", KNOWN).source
