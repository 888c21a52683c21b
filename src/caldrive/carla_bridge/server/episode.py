"""One episode of a served town: its actors, and how a step moves all of them."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TypeVar

import shapely

from caldrive.carla_bridge.axes import Placement, standing, vector_to_carla
from caldrive.carla_bridge.server import snapshot
from caldrive.carla_bridge.server.actors import Actor, NativeCar, Prop, box_of, description, is_on_ground
from caldrive.carla_bridge.server.blueprints import N_WALKERS, usual_attributes
from caldrive.carla_bridge.server.contacts import Hit, is_free, resolve_contacts
from caldrive.carla_bridge.server.friction import FrictionVolume, friction_at
from caldrive.carla_bridge.server.layouts import BoundingBox, Vector, VehicleControl
from caldrive.carla_bridge.server.layouts import Weather as CarlaWeather
from caldrive.carla_bridge.server.lights import NUMBERS, Light, LightKeeper, light_actors
from caldrive.carla_bridge.server.maps import SignalIds
from caldrive.carla_bridge.server.population import Population
from caldrive.carla_bridge.server.settings import ServerSettings
from caldrive.carla_bridge.server.signs import sign_actors
from caldrive.carla_bridge.server.snapshot import NOTHING
from caldrive.carla_bridge.server.vehicles import Vehicle
from caldrive.carla_bridge.server.walkers import HEIGHT, RADIUS, UP, Walker
from caldrive.carla_bridge.server.weather import as_carla, drawn
from caldrive.datatypes import PedestrianState, VehicleState
from caldrive.world.rendering.camera import SceneState
from caldrive.world.scene.weather import weather
from caldrive.world.town import Town

LOOK_AT_LIMITS = 10  # steps from one look at the limit under a vehicle to the next
NATIVE_CARS = {4.2: "vehicle.seat.leon", 4.6: "vehicle.tesla.model3", 4.9: "vehicle.volkswagen.t2"}  # by their length
NATIVE_HEIGHT = 1.5  # m
GRAVITY = 9.81  # m/s²
PERSON_BOX = BoundingBox(Vector(), Vector(RADIUS, RADIUS, HEIGHT / 2))
Kind = TypeVar("Kind", bound=Actor)


class Episode:
    """What is there, by number, and the time (s). ids: of lights and signs; numbers: for actors, which no
    actor of another episode has. Raises ValueError where the town has no room for all inhabitants."""

    def __init__(
        self, number: int, town: Town, settings: ServerSettings, ids: SignalIds, numbers: Iterator[int]
    ) -> None:
        self.number, self.town, self.time, self.delta = number, town, 0.0, 0.0
        self.hits: list[Hit] = []
        self.gravity = GRAVITY
        """m/s² that IMUs feel."""
        self.has_changed = False
        """Whether actors came or went since the last snapshot."""
        self._steps, self._numbers = 0, numbers
        self.set_weather(as_carla(weather(settings.weather)))
        self._population = Population(town.roads, settings.cars, settings.people, settings.seed)
        self.spectator = Actor(next(self._numbers), description("spectator"), Placement(z=50.0))
        lights, signs = light_actors(town.roads, numbers, ids.lights), sign_actors(town, numbers, ids.signs)
        self.lights = LightKeeper(lights, self._population.lights)
        self._actors: dict[int, Actor] = {one.id: one for one in (self.spectator, *lights, *signs)}
        self._by_kind: dict[type[Actor], list[Actor]] = {}
        self._natives: dict[str, Actor] = {}
        self._signs: dict[int, tuple[Placement, bytes]] = {}  # by number: where a sign stands, and its row in snapshots
        self._at_light: dict[int, Light | None] = {}
        shapely.prepare(town.roads.roadway)
        self._take_down()

    def set_weather(self, wanted: CarlaWeather) -> None:
        """The weather from now on."""
        self.weather, self.drawn_weather = wanted, drawn(wanted)

    def next_number(self) -> int:
        """The number of the next actor."""
        return next(self._numbers)

    def get(self, number: int) -> Actor | None:
        """An actor by its number."""
        return self._actors.get(number)

    def all(self, kind: type[Kind]) -> list[Kind]:
        """The actors of a kind, in the order of their numbers."""
        if kind not in self._by_kind:
            self._by_kind[kind] = [one for one in self._actors.values() if isinstance(one, kind)]
        return [one for one in self._by_kind[kind] if isinstance(one, kind)]

    def add(self, actor: Actor) -> None:
        """A client's actor is there from now on."""
        self._actors[actor.id], self.has_changed = actor, True
        self._by_kind.clear()
        if actor.parent is not None:
            actor.parent.children.append(actor)

    def remove(self, actor: Actor) -> list[Actor]:
        """An actor goes, with all that is attached to it; returns all of them."""
        gone = [actor]
        for child in tuple(actor.children):
            gone += self.remove(child)
        if actor.parent is not None and actor in actor.parent.children:
            actor.parent.children.remove(actor)
        self._actors.pop(actor.id, None)
        self._by_kind.clear()
        self.has_changed = True
        return gone

    def has_room(self, box: VehicleState) -> bool:
        """Whether a new body fits there."""
        return is_free(box, self.bodies(), self.props(), self.town.obstacles)

    def actor_of(self, name: str) -> Actor | None:
        """The actor behind the id of a car or a person, None for what stands in the town."""
        if name in self._natives:
            return self._natives[name]
        number = name.rpartition("#")[2]
        return self._actors.get(int(number)) if number.isdigit() else None

    def step(self, delta: float) -> None:
        """Moves everything on by delta seconds."""
        self.delta, self.time, self._steps = delta, self.time + delta, self._steps + 1
        vehicles, walkers = self.all(Vehicle), self.all(Walker)
        before, volumes = [vehicle.state for vehicle in vehicles], self.all(FrictionVolume)
        for vehicle in vehicles:
            vehicle.friction_here = friction_at(vehicle.place, volumes)
            vehicle.step(delta)
        for walker in walkers:
            walker.step(delta)
        self._population.move_to(self.time, self.vehicle_states(), self.walker_states())
        self._take_down()
        there = [one for one in vehicles if is_on_ground(one.place)]
        self.hits = resolve_contacts(there, self.bodies(), self.props(), self.town.obstacles)
        for vehicle, state in zip(vehicles, before, strict=True):
            vehicle.note_motion(state, delta)
        if self._steps % LOOK_AT_LIMITS == 1:
            known: list[Vehicle | NativeCar] = [*vehicles, *self.all(NativeCar)]
            for one in known:
                one.limit = self._limit_at(one)

    def _limit_at(self, one: Vehicle | NativeCar) -> float:
        try:
            return self.town.roads.lane_at(one.place.pose)[0].limit
        except ValueError:  # beside the road the last one goes on
            return one.limit

    def _take_down(self) -> None:
        """Takes down who is where now."""
        self.lights.update(self.time)
        self.cars, self.people = self._population.at(self.time)
        for car in self.cars:
            actor = self._native(car, NATIVE_CARS.get(car.length, "vehicle.tesla.model3"))
            actor.own_place = standing(car.pose)
        for k, person in enumerate(self.people):
            actor = self._native(person, f"walker.pedestrian.{1 + k % N_WALKERS:04}")
            actor.own_place = standing(person.pose, UP)
        there = [*self.cars, *self.vehicle_states()]
        ids = [actor.id for actor in map(self.actor_of, (car.id for car in there)) if actor]
        self._at_light = dict(zip(ids, self.lights.before([car.pose for car in there]), strict=True))

    def _native(self, body: VehicleState | PedestrianState, kind: str) -> Actor:
        """The actor of one of the inhabitants, as it moves now."""
        if body.id not in self._natives:
            about = description(kind, **usual_attributes(kind) | {"role_name": "autopilot"})
            actor = Actor(next(self._numbers), about, standing(body.pose), box=PERSON_BOX)
            if isinstance(body, VehicleState):
                box = box_of((body.length, body.width, NATIVE_HEIGHT), NATIVE_HEIGHT / 2)
                actor = NativeCar(actor.id, about, actor.own_place, box=box)
                actor.limit = self._limit_at(actor)
            self._natives[body.id] = self._actors[actor.id] = actor
            self._by_kind.clear()
        actor = self._natives[body.id]
        c, s = math.cos(body.pose.heading), math.sin(body.pose.heading)
        actor.motion = (vector_to_carla(body.speed * c, body.speed * s), NOTHING, NOTHING)
        return actor

    def walker_states(self) -> list[PedestrianState]:
        """The clients' walkers, as the embedded world knows people."""
        return [
            one.state(bool(shapely.contains_xy(self.town.roads.roadway, one.own_place.x, one.own_place.y)))
            for one in self.all(Walker)
            if is_on_ground(one.own_place)
        ]

    def vehicle_states(self, but: int = 0) -> list[VehicleState]:
        """Likewise their vehicles, but one."""
        return [one.box_state() for one in self.all(Vehicle) if one.id != but and is_on_ground(one.place)]

    def props(self) -> list[Prop]:
        """Things that clients put somewhere where they are met."""
        return [one for one in self.all(Prop) if is_on_ground(one.place)]

    def bodies(self) -> list[VehicleState | PedestrianState]:
        """Everybody who moves."""
        return [*self.cars, *self.people, *self.vehicle_states(), *self.walker_states()]

    def scene(self, camera: Placement, carrier: Actor | None) -> SceneState:
        """What a camera may see; not the vehicle that carries it, where the camera is inside its box."""
        own = carrier.id if isinstance(carrier, Vehicle) and _is_inside(carrier, camera) else 0
        here, vehicles = VehicleState(camera.pose), [*self.cars, *self.vehicle_states(but=own)]
        lights = {one.post.id: one.state for one in self.lights.actors}
        people = [*self.people, *self.walker_states()]
        return SceneState(self.drawn_weather, here, vehicles, people, lights, self.time)

    def snapshot(self, frame: int) -> bytes:
        """Who is where now, as it goes to clients."""
        self.has_changed = False
        place = snapshot.header(snapshot.Sensor.WORLD, frame, self.time)
        return b"".join((place, snapshot.world_head(self.number, self.time, self.delta), *self._rows()))

    def _rows(self) -> list[bytes]:
        """All actors, as a snapshot has them."""
        absent = self._natives.keys() - {one.id for one in self.cars} - {one.id for one in self.people}
        missing = {self._natives[name].id for name in absent}
        return [self._row(one) for one in self._actors.values() if one.id not in missing]

    def _row(self, actor: Actor) -> bytes:
        """An actor, as a snapshot has it: a sign always in the same way, as long as nobody moves it."""
        if not (actor.sign and type(actor) is Actor):
            return snapshot.actor_row(actor.id, actor.place, actor.motion, self._part(actor))
        place, row = self._signs.get(actor.id, (None, b""))
        if place is not actor.own_place:
            row = snapshot.actor_row(actor.id, actor.place, actor.motion, self._part(actor))
            self._signs[actor.id] = actor.own_place, row
        return row

    def _part(self, actor: Actor) -> bytes:
        """What an actor's kind adds to its row."""
        if isinstance(actor, Light):
            return self.lights.part(actor, self.time)
        if isinstance(actor, Vehicle | NativeCar):
            light = self._at_light.get(actor.id)
            at = (NUMBERS[light.state], light.id) if light else None
            control = actor.control if isinstance(actor, Vehicle) else VehicleControl()
            return snapshot.vehicle_part(control, actor.limit, at)
        if isinstance(actor, Walker):
            return snapshot.walker_part(actor.control)
        return snapshot.sign_part(actor.sign) if actor.sign else b""

    def close(self) -> None:
        """Ends the traffic."""
        self._population.close()


def _is_inside(vehicle: Vehicle, camera: Placement) -> bool:
    """Whether a camera is within a vehicle's box."""
    pose, c, s = vehicle.state.pose, math.cos(vehicle.state.pose.heading), math.sin(vehicle.state.pose.heading)
    dx, dy = camera.x - pose.x, camera.y - pose.y
    ahead, left = abs(dx * c + dy * s), abs(dy * c - dx * s)
    return ahead < vehicle.config.length / 2 and left < vehicle.config.width / 2 and camera.z < 2 * vehicle.box.extent.z
