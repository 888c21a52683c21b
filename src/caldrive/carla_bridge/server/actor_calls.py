"""The calls about actors of all kinds: what there is, spawning and destroying, places and motion."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any, TypeVar

from caldrive.carla_bridge.axes import Placement, compose
from caldrive.carla_bridge.server.actors import OFF_GROUND, Actor, ActorLayout, Prop, box_of, is_on_ground
from caldrive.carla_bridge.server.blueprints import BLUEPRINTS, REFUSED, SIZES, VOLUME
from caldrive.carla_bridge.server.calls import call
from caldrive.carla_bridge.server.episode import PERSON_BOX
from caldrive.carla_bridge.server.friction import volume
from caldrive.carla_bridge.server.layouts import ActorDescription, BoundingBox, Transform, Vector, placement
from caldrive.carla_bridge.server.sensor_actors import SensorActor, checked
from caldrive.carla_bridge.server.server import Server
from caldrive.carla_bridge.server.vehicles import Vehicle, config_of
from caldrive.carla_bridge.server.walkers import RADIUS, UP, Walker
from caldrive.carla_bridge.server.wire import Refusal
from caldrive.datatypes import VehicleState
from caldrive.world.traffic.ego import EgoState

OCCUPIED = "Spawn failed because of collision at spawn position"  # programs look for these words
MOST_ACTORS = 1000  # that clients have spawned
DEEPEST = 8  # actors that are attached to one another in a row
FASTEST = 100.0  # m/s that a client may give an actor
Kind = TypeVar("Kind", bound=Actor)


class ActorCalls:
    """They answer from one server."""

    def __init__(self, server: Server) -> None:
        self._server = server

    def find(self, number: int, kind: type[Kind]) -> Kind:
        """A client's actor of a kind. Raises Refusal where there is none."""
        actor = self._server.episode.get(number)
        if not isinstance(actor, kind):
            what = f"a {actor.kind}" if actor else "none"
            raise Refusal(f"found {what} under the number {number}, wanted a {kind.__name__} of a client")
        return actor

    def layout(self, actor: Actor) -> ActorLayout:
        """An actor as it goes to a client."""
        return actor.layout(self._server.streams.token(actor.stream) if actor.stream else b"")

    @call("get_actor_definitions")
    def definitions(self, caller: int) -> list[Any]:
        """The blueprint library."""
        return [blueprint.layout() for blueprint in BLUEPRINTS.values()]

    @call("get_spectator")
    def spectator(self, caller: int) -> ActorLayout:
        """Whoever looks at the world; it is only a place."""
        return self.layout(self._server.episode.spectator)

    @call("get_actors_by_id")
    def actors(self, caller: int, numbers: list[int]) -> list[ActorLayout]:
        """Those that there are."""
        found = (self._server.episode.get(number) for number in numbers)
        return [self.layout(actor) for actor in found if actor is not None]

    @call("spawn_actor")
    def spawn_alone(self, caller: int, asked: ActorDescription, at: Transform) -> ActorLayout:
        """A new actor."""
        return self.layout(self.spawn(caller, asked, placement(at), None))

    @call("spawn_actor_with_parent")
    def spawn_attached(
        self, caller: int, asked: ActorDescription, at: Transform, parent: int, attachment: int = 0, socket: str = ""
    ) -> ActorLayout:
        """A new actor that goes where another goes, rigidly in every kind of attachment."""
        return self.layout(self.spawn(caller, asked, placement(at), parent))

    def spawn(self, caller: int, asked: ActorDescription, at: Placement, parent: int | None) -> Actor:
        """A new actor, at a place that is relative to its parent's. Raises Refusal."""
        episode = self._server.episode
        if asked.id not in BLUEPRINTS:
            raise Refusal(f"found no blueprint {asked.id[:80]!r}, wanted one of get_blueprint_library()")
        if sum(actor.owner > 0 for actor in episode.all(Actor)) >= MOST_ACTORS:
            raise Refusal(f"found {MOST_ACTORS} actors of clients, wanted fewer: destroy some")
        carrier = episode.get(parent) if parent else None
        if parent and carrier is None:
            raise Refusal(f"found no actor {parent} to attach {asked.id} to, wanted one that is there")
        if carrier is not None and carrier.depth >= DEEPEST:
            raise Refusal(f"found {DEEPEST} actors attached to each other in a row, wanted fewer: attach to the first")
        actor = self._made(asked, at, carrier)
        actor.id, actor.owner, actor.parent = episode.next_number(), caller, carrier
        if actor.stream:
            actor.stream = actor.id + 1
        episode.add(actor)
        return actor

    def _made(self, asked: ActorDescription, at: Placement, carrier: Actor | None) -> Actor:
        """The actor, still without a number. Raises Refusal where it cannot be."""
        kind = asked.id
        if kind in REFUSED:
            raise Refusal(f"found {kind}, which caldrive does not simulate, wanted another sensor: see docs/carla.md")
        if kind.startswith("sensor."):
            streams = 0 if kind == "sensor.other.lane_invasion" else 1
            return checked(SensorActor(0, asked, at, stream=streams))
        if kind == "controller.ai.walker":
            return Actor(0, asked, at)
        world = compose(carrier.place, at) if carrier else at
        if kind.startswith("walker."):
            self._require_room(world, 2 * RADIUS, 2 * RADIUS)
            z = world.z if world.z <= -OFF_GROUND else UP
            return Walker(0, asked, Placement(world.x, world.y, z, world.heading), box=PERSON_BOX, before=world.pose)
        if kind == VOLUME:
            return volume(asked, at)
        length, width, height = SIZES[kind]
        if kind.startswith("vehicle."):
            self._require_room(world, length, width)
            state, box = EgoState(world.pose), box_of((length, width, height), height / 2)
            return Vehicle(0, asked, world, box=box, config=config_of(length, width), state=state)
        return Prop(0, asked, at, box=box_of((length, width, height), height / 2))

    def _require_room(self, at: Placement, length: float, width: float) -> None:
        if is_on_ground(at) and not self._server.episode.has_room(VehicleState(at.pose, length=length, width=width)):
            raise Refusal(OCCUPIED)

    @call("destroy_actor")
    def destroy(self, caller: int, number: int) -> bool:
        """An actor of a client goes; the town's own stay."""
        actor = self._server.episode.get(number)
        if actor is None or not actor.owner:
            return False
        self._server.destroy(actor)
        return True

    @call("get_actor_bounding_box")
    def bounding_box(self, caller: int, number: int) -> BoundingBox:
        """Its box; an empty one where it is gone, as a client's traffic manager would end with its process."""
        actor = self._server.episode.get(number)
        return actor.box if actor else BoundingBox()

    @call("set_actor_transform")
    def set_transform(self, caller: int, number: int, at: Transform) -> None:
        """It is there from now on."""
        actor = self.find(number, Actor)
        if actor.owner or actor is self._server.episode.spectator:
            actor.put(placement(at))

    @call("set_actor_location")
    def set_location(self, caller: int, number: int, at: Vector) -> None:
        """Likewise, and it is turned as before."""
        actor = self.find(number, Actor)
        new, old = placement(Transform(at)), actor.own_place
        heading = actor.place.heading if isinstance(actor, Vehicle) else old.heading
        if actor.owner or actor is self._server.episode.spectator:
            actor.put(Placement(new.x, new.y, new.z, heading, old.pitch, old.roll))

    @call("set_actor_target_velocity")
    def set_velocity(self, caller: int, number: int, velocity: Vector) -> None:
        """A vehicle has that speed along its heading at once."""
        vehicle = self.find(number, Vehicle)
        heading, (x, y) = vehicle.state.pose.heading, plane(velocity, FASTEST)
        vehicle.state = replace(vehicle.state, speed=x * math.cos(heading) + y * math.sin(heading))

    @call("set_actor_target_angular_velocity")
    def set_turning(self, caller: int, number: int, turning: Vector) -> None:
        """A vehicle on its wheels does not turn by itself."""

    @call("enable_actor_constant_velocity")
    def hold_speed(self, caller: int, number: int, velocity: Vector) -> None:
        """A vehicle keeps a speed along its heading."""
        self.find(number, Vehicle).constant_speed = plane(velocity, FASTEST)[0]

    @call("disable_actor_constant_velocity")
    def release_speed(self, caller: int, number: int) -> None:
        """It does no longer."""
        self.find(number, Vehicle).constant_speed = None

    @call("set_actor_simulate_physics")
    def simulate_physics(self, caller: int, number: int, is_on: bool) -> None:
        """Whether it moves by itself."""
        actor = self._server.episode.get(number)
        if isinstance(actor, Vehicle):
            actor.has_physics = is_on

    @call("set_actor_collisions")
    def set_collisions(self, caller: int, number: int, is_on: bool) -> None:
        """Whether contacts act on it."""
        actor = self._server.episode.get(number)
        if isinstance(actor, Vehicle):
            actor.collides = is_on

    @call("set_actor_enable_gravity")
    def enable_gravity(self, caller: int, number: int, is_on: bool) -> None:
        """Everything stays on the ground; but without gravity the tyres of a vehicle do not hold."""
        actor = self._server.episode.get(number)
        if isinstance(actor, Vehicle):
            actor.has_gravity = is_on

    @call("set_actor_dead")
    def set_dead(self, caller: int, number: int) -> None:
        """Nobody dies here."""

    @call("add_actor_impulse")
    def add_impulse(self, caller: int, number: int, impulse: Vector) -> None:
        """N s; what is along its heading moves it."""
        self.find(number, Vehicle).kick(plane(impulse, 1e9))

    @call("add_actor_impulse_at_location")
    def add_impulse_at(self, caller: int, number: int, impulse: Vector, at: Vector) -> None:
        """Likewise, wherever it acts."""
        self.add_impulse(caller, number, impulse)

    @call("add_actor_force")
    def add_force(self, caller: int, number: int, force: Vector) -> None:
        """N, through the next step."""
        self.find(number, Vehicle).push(plane(force, 1e9))

    @call("add_actor_force_at_location")
    def add_force_at(self, caller: int, number: int, force: Vector, at: Vector) -> None:
        """Likewise, wherever it acts."""
        self.add_force(caller, number, force)

    @call("add_actor_angular_impulse")
    @call("add_actor_torque")
    def turn(self, caller: int, number: int, impulse: Vector) -> None:
        """A vehicle on its wheels does not turn by itself."""


def plane(vector: Vector, most: float) -> tuple[float, float]:
    """The part of a vector on the plane, in our axes, each number within limits; 0 for what is no number."""
    return finite(vector.x, most), -finite(vector.y, most)


def finite(value: float, most: float) -> float:
    """A number from -most to most."""
    return min(max(value, -most), most) if value == value else 0.0
