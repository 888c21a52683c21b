"""The other cars: SUMO in this process. It knows the ego as one of its vehicles, and is told what the lights show.

SUMO's conventions end here: its positions are those of front bumpers, its angles run clockwise from north in degrees.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence, Set
from typing import Any

import libsumo
import numpy as np

from caldrive.datatypes import PedestrianState, Pose, VehicleState
from caldrive.geometry import to_local, wrap_angle
from caldrive.world.roads.network import Lane, RoadNetwork
from caldrive.world.traffic.guests import Guests, move_in_sumo
from caldrive.world.traffic.incidents import Incident, Incidents
from caldrive.world.traffic.start_places import free_places
from caldrive.world.traffic.sumo_inputs import SumoLights, speed_caps
from caldrive.world.traffic.sumo_process import (
    MODELS,
    has_sumo,
    load_sumo,
    one_sentence,
    release_sumo,
    stop_sumo,
    take_sumo,
)
from caldrive.world.traffic.traffic_lights import TrafficLights

EGO = "ego"
POSITION, PLACE, ANGLE, SPEED = 0x42, 0x39, 0x43, 0x40  # numbers that libsumo has for what it can be asked
LONGEST_WAIT = 60.0  # s until a car that is stuck is moved elsewhere
OUT_OF_SIGHT, BESIDE = 70.0, 25.0  # m from the ego, where its camera looks and elsewhere
LONGEST_WAY, LAST_EDGES = 30, 6  # edges of a random way, and how many of it are left when it gets a new one
CHECK_EVERY = 20  # steps, from one look after cars that are stuck or near the end of their way to the next


class Traffic:
    """One SUMO simulation of n cars; there can be one in a process, until its `release`.

    ego: None where there is none. guests: cars that others drive, and that may come and go. cars: all but these and the
    ego, as of the last step; heights: of the roads under them (m), by their ids, where roads run above each other.
    Raises ValueError for more cars than the town holds, RuntimeError where another simulation is under way.
    """

    def __init__(
        self, roads: RoadNetwork, n: int, seed: int, dt: float, ego: VehicleState | None, lights: TrafficLights
    ) -> None:
        free_places(roads, n, ego.pose if ego else None)  # too many cars are refused before anything is made for each
        self.roads, self.rng, self.dt = roads, np.random.default_rng(seed), dt
        self.size = {f"car{i}": MODELS[int(self.rng.integers(len(MODELS)))] for i in range(n)}
        starts = self._random_places(n, ego)
        self.heights: dict[str, float] = {}
        self._capped: set[str] = set()  # cars that are told how fast they may drive
        self._incidents = Incidents(self.rng)
        self._braking: str | None = None  # who brakes harder than others may
        self.guests = Guests(roads)
        take_sumo(self)
        try:
            with one_sentence(roads.name):
                self._start(seed, ego, starts, lights)
        except BaseException:
            self.close()  # nobody else can: there is no traffic yet
            raise

    def _start(
        self, seed: int, ego: VehicleState | None, starts: Sequence[tuple[Lane, float]], lights: TrafficLights
    ) -> None:
        """Begins the simulation, with each car at its place."""
        load_sumo(self.roads, self.dt, seed)
        if ego is not None:
            self._add_ego(ego)
        for name, (lane, s) in zip(self.size, starts, strict=True):
            self._add(name, lane, s)
        self._lights = SumoLights(lights)
        libsumo.simulationStep()
        self.cars = self._read()

    def release(self) -> None:
        """Lets another traffic have SUMO; this one cannot be moved any more."""
        release_sumo(self)

    def close(self) -> None:
        """Ends the simulation, unless another traffic has SUMO by now."""
        if has_sumo(self):
            stop_sumo()

    def _random_places(self, n: int, ego: VehicleState | None) -> list[tuple[Lane, float]]:
        """Random free places for n cars, away from the ego."""
        free = free_places(self.roads, n, ego.pose if ego else None)
        return [free[int(i)] for i in self.rng.permutation(len(free))[:n]]

    def _random_way(self, edge: str) -> list[str]:
        """A random way through the town, by edges."""
        edges, lane = [edge], next(lane for lane in self.roads.driveable if _edge(lane.id) == edge)
        while len(edges) < LONGEST_WAY and lane.successors:
            lane = self.roads.lanes[lane.successors[int(self.rng.integers(len(lane.successors)))]]
            if not lane.internal:
                edges.append(_edge(lane.id))
        return edges

    def _add(self, name: str, lane: Lane, s: float) -> None:
        edges = self._random_way(_edge(lane.id))
        route = f"{name}@{libsumo.simulation.getTime():.1f}"
        libsumo.route.add(route, edges)
        model, index = self.size[name][0], lane.id.rsplit("_", 1)[1]
        libsumo.vehicle.add(name, route, typeID=model, departPos=f"{s:.2f}", departLane=index, departSpeed="0")

    def take_over(self, car: VehicleState, lane: Lane, s: float) -> None:
        """A car that drives in a lane, s m along it, is one of these from now on."""
        model = next(name for name, length, width in MODELS if (length, width) == (car.length, car.width))
        self.size[car.id] = (model, car.length, car.width)
        with one_sentence(self.roads.name):
            self._add(car.id, lane, s)
            libsumo.vehicle.moveTo(car.id, lane.id, min(s + car.length / 2, lane.line.length - 0.1))
            libsumo.vehicle.setPreviousSpeed(car.id, car.speed)

    def _add_ego(self, ego: VehicleState) -> None:
        lane, s = self.roads.lane_at(ego.pose)
        libsumo.route.add("ego", [_edge(lane.id)])
        libsumo.vehicle.add(EGO, "ego", departPos=f"{min(s + ego.length / 2, lane.line.length):.2f}", departSpeed="0")
        libsumo.vehicle.setLength(EGO, ego.length)
        libsumo.vehicle.setWidth(EGO, ego.width)

    def step(self, time: float, ego: VehicleState | None, people: Sequence[PedestrianState]) -> None:
        """Moves the cars on by dt, under what the lights show now; time in s."""
        if not has_sumo(self):
            raise RuntimeError(
                "found an episode that has lost SUMO, which simulates one at a time, wanted a running one: "
                "call reset(scenario)"
            )
        with one_sentence(self.roads.name):
            self._move(time, ego, people)

    def _move(self, time: float, ego: VehicleState | None, people: Sequence[PedestrianState]) -> None:
        self._lights.update()
        if ego is not None:
            move_in_sumo(EGO, ego)
        self.guests.move()
        self._cap_speeds(time, ego, people)
        libsumo.simulationStep()
        if round(time / self.dt) % CHECK_EVERY == 0:
            self._look_after(ego)
        self.cars = self._read()

    def _cap_speeds(self, time: float, ego: VehicleState | None, people: Sequence[PedestrianState]) -> None:
        """Lets cars stop before people on the road and where something happens to them, and those drive on that had
        to."""
        caps = speed_caps(self.cars, people)
        present = {car.id for car in self.cars}
        incident = self._incidents.step(time, self.dt, ego, self.cars) if ego is not None else None
        if incident is not None and incident.name in present:
            caps[incident.name] = min(incident.allowed(time), caps.get(incident.name, math.inf))
        self._brake_hard(incident, present)
        for name in sorted((self._capped - caps.keys()) & present):
            libsumo.vehicle.setSpeed(name, -1.0)
        for name, speed in caps.items():
            libsumo.vehicle.setSpeed(name, speed)
        self._capped = set(caps)

    def _brake_hard(self, incident: Incident | None, present: Set[str]) -> None:
        """Lets the car that something happens to brake as hard as it has to, and only it."""
        name = incident.name if incident is not None and incident.name in present else None
        if name == self._braking:
            return
        if self._braking is not None and self._braking in present:
            libsumo.vehicle.setDecel(self._braking, libsumo.vehicletype.getDecel(self.size[self._braking][0]))
        if name is not None and incident is not None:
            libsumo.vehicle.setDecel(name, max(incident.brake, libsumo.vehicle.getDecel(name)))
        self._braking = name

    def _look_after(self, ego: VehicleState | None) -> None:
        """Gives cars near the end of their way a new one, and moves those that are stuck while nobody sees it."""
        present = set(libsumo.vehicle.getIDList())
        for name in self.size:
            if name not in present:
                if name not in libsumo.simulation.getPendingVehicles():
                    self._add(name, *self._random_places(1, ego)[0])
                continue
            way, index = libsumo.vehicle.getRoute(name), libsumo.vehicle.getRouteIndex(name)
            near_end = index >= 0 and len(way) - index < LAST_EDGES
            if near_end and libsumo.vehicle.getRoadID(name) == way[index]:
                libsumo.vehicle.setRoute(name, self._random_way(way[index]))
            stuck = libsumo.vehicle.getWaitingTime(name) > LONGEST_WAIT
            if stuck and not (ego is not None and in_sight(ego, libsumo.vehicle.getPosition(name))):
                libsumo.vehicle.unsubscribe(name)  # SUMO would miss it at its next step
                libsumo.vehicle.remove(name)

    def _read(self) -> tuple[VehicleState, ...]:
        """All cars as SUMO has them. It is asked once for all of them: that takes a quarter of the time."""
        driven = {EGO, *self.guests.known}
        names, watched = libsumo.vehicle.getIDList(), libsumo.vehicle.getAllSubscriptionResults()
        names = [name for name in names if name not in driven]
        new = [name for name in names if name not in watched]
        if new:
            for name in new:
                libsumo.vehicle.subscribe(name, (POSITION, ANGLE, SPEED, *([] if self.roads.is_flat else [PLACE])))
            watched = libsumo.vehicle.getAllSubscriptionResults()
        if not self.roads.is_flat:
            self.heights = {name: float(watched[name][PLACE][2]) for name in names}
        return tuple(self._state(name, watched[name]) for name in names)

    def _state(self, name: str, values: Mapping[int, Any]) -> VehicleState:
        """A car in our axes."""
        _, length, width = self.size[name]
        (x, y), heading = values[POSITION], wrap_angle(math.radians(90.0 - values[ANGLE]))
        center = Pose(x - length / 2 * math.cos(heading), y - length / 2 * math.sin(heading), heading)
        return VehicleState(center, values[SPEED], length=length, width=width, id=name)


def in_sight(ego: VehicleState, place: tuple[float, float]) -> bool:
    """Whether somebody at a place may be in the ego's pictures, or so close that others would notice."""
    ahead, left = to_local(ego.pose, np.array(place)).tolist()
    away = math.hypot(ahead, left)
    return away < BESIDE or (away < OUT_OF_SIGHT and ahead > 0.5 * away)


def _edge(lane: str) -> str:
    """The id of the edge that a lane is part of."""
    return lane.rsplit("_", 1)[0]
