"""What counts as an infraction: the rules of the published benchmarks, and stricter ones of our own.

Sources: the code of CoRL-2017's benchmark and of NoCrash's (driving-benchmarks, `metrics.py` and `carla100`), at 10
frames/s.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from caldrive.datatypes import ContactKind, LightState
from caldrive.results import InfractionKind

RISE_FRAMES = 10  # within which a share of the car's area has to rise
SHARE_RISE = {InfractionKind.OPPOSITE_LANE: 0.4, InfractionKind.SIDEWALK: 0.3}
REST_FRAMES = {  # until one of the kind counts again
    InfractionKind.OPPOSITE_LANE: 20,
    InfractionKind.SIDEWALK: 20,
    InfractionKind.RED_LIGHT: 20,
    InfractionKind.YELLOW_LIGHT: 20,
    InfractionKind.SPEEDING: 20,
    InfractionKind.COLLISION_OBJECT: 20,
    InfractionKind.COLLISION_CAR: 30,
    InfractionKind.COLLISION_PERSON: 100,
}
COLLISION = {
    ContactKind.OBJECT: InfractionKind.COLLISION_OBJECT,
    ContactKind.CAR: InfractionKind.COLLISION_CAR,
    ContactKind.PERSON: InfractionKind.COLLISION_PERSON,
}
CROSSING = {LightState.RED: InfractionKind.RED_LIGHT, LightState.YELLOW: InfractionKind.YELLOW_LIGHT}
MOST_FRAMES = 10  # over which impulses are added up
APART_FRAMES = 10  # without a touch, after which the same thing is touched anew


@dataclass(frozen=True)
class Intensity:
    """How hard a collision has to be."""

    least: float
    """N s that have to be exceeded."""
    frames: int
    """Frames over which the impulses of all contacts of a kind are added up."""


@dataclass(frozen=True)
class Rules:
    """What a benchmark counts."""

    name: str
    """As results say it."""
    collisions: Mapping[ContactKind, Intensity] | None
    """How hard a touch has to be; None where each counts, however soft, once for each thing that is touched."""
    closed: tuple[LightState, ...]
    """What a light shows while its stop line must not be crossed."""


# Table 2 of the paper. `collision_*`: frames_skip 10, 10 and 5, threshold 400, 400 and 300.
CORL2017 = Rules(
    name="corl2017",
    collisions={
        ContactKind.OBJECT: Intensity(400.0, frames=10),
        ContactKind.CAR: Intensity(400.0, frames=10),
        ContactKind.PERSON: Intensity(300.0, frames=5),
    },
    closed=(LightState.RED,),
)
# NoCrash, `_has_agent_collided`: half of these in one frame. It reports crossings while a light is not green.
NOCRASH = Rules(
    name="nocrash",
    collisions={
        ContactKind.OBJECT: Intensity(200.0, frames=1),
        ContactKind.CAR: Intensity(200.0, frames=1),
        ContactKind.PERSON: Intensity(150.0, frames=1),
    },
    closed=(LightState.RED, LightState.YELLOW),
)
# Our own: what a driving examiner would say.
STRICT = Rules(name="strict", collisions=None, closed=(LightState.RED,))
RULES: Mapping[str, Rules] = {rules.name: rules for rules in (CORL2017, NOCRASH, STRICT)}
