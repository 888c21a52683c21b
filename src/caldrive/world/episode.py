"""One episode in a town: the ego, everybody who moves, and what is true of them, from the start to the last step."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from caldrive.datatypes import DT, Contact, Control, PedestrianState, VehicleState
from caldrive.geometry import boxes_of, moved, positions
from caldrive.scenarios import Scenario
from caldrive.timing import Timed, untimed
from caldrive.world.roads.route import Route
from caldrive.world.town import Town
from caldrive.world.traffic.collisions import half_diagonal, obstacle_of, resolve
from caldrive.world.traffic.ego import EgoState, VehicleConfig, advance
from caldrive.world.traffic.parked_cars import ParkedCars
from caldrive.world.traffic.pedestrians import Pedestrians
from caldrive.world.traffic.sumo_process import MODELS
from caldrive.world.traffic.traffic_lights import TrafficLights
from caldrive.world.traffic.vehicles import Traffic
from caldrive.world.truth.label_rig import LabelRig, WorldState

ACTOR_REACH = 3.0  # m from the centre of a car or person to its farthest corner, at most
UNSEEN_DEMAND = 1 / 45  # 1/s: how often somebody comes to a light where no cars drive
PARKED_SHARE = 0.6  # parked cars for each that drives
SCREENS = ("tree", "hedge", "billboard")  # what somebody may come from behind of
PUSHED = 2.0  # m that a first contact may move the ego towards another, at most


class Episode:
    """The ego among others. state: who is where now; truth: all that is true of it.

    Raises ValueError where the town has no room for all of them, RuntimeError where another world of this process has
    traffic already.
    """

    def __init__(
        self, town: Town, scenario: Scenario, route: Route, vehicle: VehicleConfig, timed: Timed = untimed
    ) -> None:
        self.town, self.scenario, self.route, self.vehicle, self._timed = town, scenario, route, vehicle, timed
        lights, people, cars, parked = (np.random.default_rng([scenario.seed, i]) for i in range(4))
        self._ego = EgoState(route.line.pose_at(0.0))
        self._lights = TrafficLights(town.roads, lights, demand=0.0 if scenario.n_vehicles else UNSEEN_DEMAND)
        self._parked = ParkedCars(
            town.roads, round(PARKED_SHARE * scenario.n_vehicles), parked, ego=self._ego_box(),
            near=town.obstacles.near, models=MODELS,
        )  # fmt: skip
        screens = positions([*self._parked.states(), *(prop for prop in town.scenery if prop.kind in SCREENS)])
        self._pedestrians = Pedestrians(town.roads, scenario.n_pedestrians, people, scenario.crossing, screens)
        self.labels = LabelRig(town, route, scenario, vehicle.front_axle, self._lights.states())
        self._traffic: Traffic | None = None
        if scenario.n_vehicles:
            self._traffic = Traffic(
                town.roads,
                n=scenario.n_vehicles,
                seed=int(cars.integers(2**31)),
                dt=DT,
                ego=self._ego_box(),
                lights=self._lights,
            )
        try:
            self._update(time=0.0, progress=0.0, people=self._pedestrians.states(), contacts=())
        except BaseException:
            self.close()  # nobody else can: there is no episode yet
            raise

    def step(self, control: Control) -> None:
        """Moves everything on by DT."""
        before = self.state
        self._ego = advance(self._ego, control, DT, self.vehicle)
        time, ego = round(before.time + DT, 6), self._ego_box()
        boxes = boxes_of((ego, *before.vehicles))
        with self._timed("lights"):
            self._lights.step(time, boxes)
        if self._traffic is not None:
            with self._timed("traffic (SUMO)"):
                for car in self._parked.step(DT, ego, before.vehicles):
                    self._traffic.take_over(car.state, car.lane, car.s + car.way)
                self._traffic.step(time, ego, before.pedestrians)
        with self._timed("pedestrians"):
            self._pedestrians.step(DT, boxes, self._curvature())
            people = self._pedestrians.states()
        with self._timed("contacts"):
            contacts = self._resolve_contacts((*self._cars(before.progress), *people))
        here = self._ego.pose
        progress = self.route.line.project(here.x, here.y, near=before.progress).s
        self._update(time, progress, people, contacts)

    def displace(self, left: float, turn: float) -> None:
        """Puts the ego some metres to the left and turns it (rad)."""
        self._ego = replace(self._ego, pose=moved(self._ego.pose, left=left, turn=turn))
        self._update(self.state.time, self.state.progress, self.state.pedestrians, self.state.contacts)

    def release(self) -> None:
        """Lets another episode of this process have SUMO."""
        if self._traffic is not None:
            self._traffic.release()

    def close(self) -> None:
        """Ends the simulation of the traffic."""
        if self._traffic is not None:
            self._traffic.close()

    def _ego_box(self) -> VehicleState:
        size = self.vehicle
        return VehicleState(self._ego.pose, self._ego.speed, length=size.length, width=size.width, id="ego")

    def _curvature(self) -> float:
        """Of the ego's path, as its wheels stand, 1/m."""
        return math.tan(self._ego.steer_angle) / self.vehicle.wheelbase

    def _resolve_contacts(self, actors: tuple[VehicleState | PedestrianState, ...]) -> tuple[Contact, ...]:
        """Finds contacts where everybody is now, and lets them act on the ego."""
        ego = self._ego_box()
        here, reach = ego.pose, half_diagonal(ego) + PUSHED
        near = self.town.obstacles.near(here, reach)
        x, y, reach = here.x, here.y, reach + ACTOR_REACH
        near += [
            obstacle_of(actor)
            for actor in actors
            if abs(actor.pose.x - x) < reach and abs(actor.pose.y - y) < reach
            if math.hypot(actor.pose.x - x, actor.pose.y - y) < reach
        ]
        ego, contacts = resolve(ego, near)
        self._ego = replace(self._ego, pose=ego.pose, speed=ego.speed)
        return contacts

    def _cars(self, progress: float) -> tuple[VehicleState, ...]:
        """All other cars but those on a bridge over the route, or below it."""
        if self._traffic is None:
            return ()
        cars, level, heights = self._traffic.cars, self.labels.level, self._traffic.heights
        if level is None:
            return (*cars, *self._parked.states())
        there = [*((car, heights[car.id]) for car in cars), *((car.state, car.height) for car in self._parked.cars)]
        return tuple(car for car, height in there if level.holds(car.pose.x, car.pose.y, height, progress))

    def _update(
        self, time: float, progress: float, people: tuple[PedestrianState, ...], contacts: tuple[Contact, ...]
    ) -> None:
        """Takes down who is where now, and what is true of it."""
        with self._timed("lights"):
            lights = self._lights.states()
        vehicles = self._cars(progress)
        self.state = WorldState(
            time=time,
            ego=self._ego_box(),
            vehicles=vehicles,
            pedestrians=people,
            lights=lights,
            contacts=contacts,
            progress=progress,
        )
        with self._timed("labels and truth"):
            self.truth = self.labels.truth(self.state)
