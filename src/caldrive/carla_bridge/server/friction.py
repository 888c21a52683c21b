"""How tyres hold: the friction of the wheels, or that of a volume which a vehicle is in, and the drag of the air.

CARLA's numbers have no unit that a bicycle model knows. Its usual ones stand for our ego's grip and drag, and a vehicle
with other numbers has as much more or less of them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import msgspec

from caldrive.carla_bridge.axes import Placement
from caldrive.carla_bridge.server.actors import Actor
from caldrive.carla_bridge.server.layouts import ActorDescription, PhysicsControl, Wheel
from caldrive.carla_bridge.server.wire import Refusal
from caldrive.world.traffic.ego import VehicleConfig

USUAL_FRICTION, USUAL_DRAG = Wheel().tire_friction, PhysicsControl().drag
MOST_FRICTION, MOST_EXTENT = 100.0, 1e6  # the latter in cm
CM = 100.0  # in a m
BEST = 2.0  # times the usual grip, which more friction does not raise: nor does it with real tyres


@dataclass(eq=False)
class FrictionVolume(Actor):
    """A box in which the tyres of all vehicles of clients have the same friction; of two boxes the first one counts."""

    friction: float = USUAL_FRICTION
    half: tuple[float, float, float] = (1.0, 1.0, 1.0)
    """m from its middle to its sides."""

    def holds(self, place: Placement) -> bool:
        """Whether a place lies in it."""
        own = self.place
        dx, dy, c, s = place.x - own.x, place.y - own.y, math.cos(own.heading), math.sin(own.heading)
        away = (dx * c + dy * s, dy * c - dx * s, place.z - own.z)
        return all(abs(distance) <= half for distance, half in zip(away, self.half, strict=True))


def volume(asked: ActorDescription, at: Placement) -> FrictionVolume:
    """The volume that a client asks for. Raises Refusal where its attributes cannot be read."""
    x, y, z = (asked.number(f"extent_{axis}", CM, 0.0, MOST_EXTENT) / CM for axis in "xyz")
    friction = asked.number("friction", USUAL_FRICTION, 0.0, MOST_FRICTION)
    return FrictionVolume(0, asked, at, friction=friction, half=(x, y, z))


def friction_at(place: Placement, volumes: Sequence[FrictionVolume]) -> float | None:
    """The friction of the first volume that a place is in."""
    return next((one.friction for one in volumes if one.holds(place)), None)


def require_friction(physics: PhysicsControl) -> None:
    """Raises Refusal where a friction or the drag is no number that can be."""
    for name, value in (*(("tire_friction", one.tire_friction) for one in physics.wheels), ("drag", physics.drag)):
        if not 0.0 <= value <= MOST_FRICTION:
            raise Refusal(f"found {name} {value}, wanted a number from 0 to {MOST_FRICTION:.0f}: give another one")


def own_wheels(new: PhysicsControl, old: PhysicsControl, here: float | None) -> tuple[Wheel, ...]:
    """The wheels that a client sets. Where it gives back what it read in a volume, with that volume's friction, a wheel
    keeps its own."""
    kept = [wheel.tire_friction for wheel in old.wheels]
    kept += [USUAL_FRICTION] * (len(new.wheels) - len(kept))
    return tuple(
        msgspec.structs.replace(wheel, tire_friction=own)
        if here is not None and math.isclose(wheel.tire_friction, here, rel_tol=1e-6)  # the wire has 32 bits
        else wheel
        for wheel, own in zip(new.wheels, kept, strict=False)
    )


def gripping(config: VehicleConfig, physics: PhysicsControl, here: float | None) -> VehicleConfig:
    """The bicycle model with these tyres; here: the friction of the volume it is in, if any."""
    wheels = [wheel.tire_friction for wheel in physics.wheels] or [USUAL_FRICTION]
    friction = sum(wheels) / len(wheels) if here is None else here
    grip, drag = min(friction / USUAL_FRICTION, BEST), physics.drag / USUAL_DRAG
    if grip == 1.0 and drag == 1.0:
        return config
    push = min(grip, 1.0)  # the engine gives no more on better tyres
    return replace(
        config, max_lateral=config.max_lateral * grip, max_brake=config.max_brake * grip,
        max_acceleration=config.max_acceleration * push, rolling=config.rolling * push, drag=config.drag * drag,
    )  # fmt: skip
