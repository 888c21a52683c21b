"""Patience: a car that has stood for long before something that does not go away tries to go on, slowly.

A network may see a hazard or a red light where none is, and without patience the car would stand there for ever. The
paper's controller has none. Two cases, each with its own clock:

1. A hazard that is no car and stays for longer than people take to cross: it is taken for an error until it is gone.
2. A light that stays red for long: the car rolls on a little, from where the light may look otherwise, and waits anew,
   a few times.

What is overridden is said in the decision's state (creeping) and note; the affordances in it stay as they were seen.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from caldrive.datatypes import HAZARD_DISTANCE, Affordances

CAR_AS_HAZARD = 2.5 * HAZARD_DISTANCE  # m; the car that is a hazard is seen nearer than this, errors included


@dataclass(frozen=True)
class PatienceConfig:
    """How long the car waits, and what it does then; control/presets.py has the reasons."""

    enabled: bool = True
    """Off: the car stands for as long as it sees a reason to."""
    hazard: float = 15.0
    """s before a hazard that is no car."""
    red: float = 25.0
    """s before a red light."""
    red_roll: float = 1.2
    """s that the car rolls on before a red light."""
    red_rolls: int = 2
    """How many times it does so before one light."""
    creep_speed: float = 4.0
    """km/h at which it goes on, at most."""
    standing_speed: float = 1.0
    """km/h below which it counts as standing."""


@dataclass(frozen=True)
class Waiting:
    """Seconds that the car has stood before a hazard that is no car, and before a red light, and how often it has
    rolled on before it."""

    hazard: float = 0.0
    red: float = 0.0
    rolls: int = 0


def seconds_waited(seen: bool, waited: float, patience: float, standing: bool, dt: float) -> float:
    """How long the car has stood before what it sees, or has crept on since it lost patience."""
    return waited + dt if seen and (standing or waited >= patience) else 0.0


def next_waiting(
    hazard: bool, red: bool, standing: bool, waiting: Waiting, dt: float, config: PatienceConfig
) -> Waiting:
    """The clocks after a step of dt seconds. hazard: seen, and no car; red: seen."""
    waited, rolls = waiting.red, waiting.rolls if red or standing else 0
    if red or not standing:  # a light that flickers before a standing car is still the same
        waited = seconds_waited(red, waited, config.red, standing, dt)
    if waited >= config.red + config.red_roll:
        waited, rolls = 0.0, rolls + 1
    return Waiting(seconds_waited(hazard, waiting.hazard, config.hazard, standing, dt), waited, rolls)


def overridden(
    affordances: Affordances, waiting: Waiting, hazard: bool, red: bool, config: PatienceConfig
) -> tuple[Affordances, str]:
    """What the car stops for no longer is taken out of the affordances; the note says what and why, or nothing.

    hazard, red: whether each is seen.
    """
    notes = []
    if waiting.hazard >= config.hazard:
        affordances = replace(affordances, hazard_stop=0.0)
        if hazard:
            notes.append(f"going on past a hazard that has stayed for {config.hazard:g} s and is no car")
    if waiting.red >= config.red and waiting.rolls < config.red_rolls:
        affordances = replace(affordances, red_light=0.0)
        if red:
            notes.append(f"rolling on before a light that has been red for {config.red:g} s")
    return affordances, "; ".join(notes)
