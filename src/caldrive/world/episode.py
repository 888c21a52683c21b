"""One episode in a town: the ego, everybody who moves, and what is true of them, from the start to the last step."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from caldrive.datatypes import DT, Contact, Control, VehicleState
from caldrive.geometry import moved
from caldrive.scenarios import Scenario
from caldrive.timing import Timed, untimed
from caldrive.world.roads.route import Route
from caldrive.world.town import Town
from caldrive.world.traffic.collisions import obstacle_of, resolve
from caldrive.world.traffic.ego import EgoState, VehicleConfig, advance
from caldrive.world.traffic.pedestrians import Pedestrians
from caldrive.world.traffic.traffic_lights import Lights
from caldrive.world.traffic.vehicles import Traffic
from caldrive.world.truth.label_rig import LabelRig, Moment

CONTACT_REACH = 12.0  # m within which cars and people are tested for contact


class Episode:
    """The ego among others. moment: who is where now; truth: all that is true of it.

    Raises ValueError where the town has no room for all of them, RuntimeError where another world of this process has
    traffic already.
    """

    def __init__(
        self, town: Town, scenario: Scenario, route: Route, vehicle: VehicleConfig, timed: Timed = untimed
    ) -> None:
        self.town, self.scenario, self.route, self.vehicle, self._timed = town, scenario, route, vehicle, timed
        lights, people, cars = (np.random.default_rng([scenario.seed, i]) for i in range(3))
        self._ego = EgoState(route.line.pose_at(0.0))
        self._lights = Lights(town.roads, lights)
        self._pedestrians = Pedestrians(town.roads, scenario.n_pedestrians, people, scenario.crossing)
        self._traffic: Traffic | None = None
        if scenario.n_vehicles:
            seed = int(cars.integers(2**31))
            self._traffic = Traffic(town.roads, scenario.n_vehicles, seed, DT, self._ego_box(), self._lights)
        self.labels = LabelRig(town, route, scenario, vehicle.front_axle)
        self._look(time=0.0, progress=0.0, contacts=())

    def step(self, control: Control) -> None:
        """Moves everything on by DT."""
        before = self.moment
        self._ego = advance(self._ego, control, DT, self.vehicle)
        time, ego = round(before.time + DT, 6), self._ego_box()
        with self._timed("lights"):
            self._lights.step(time, (ego, *before.vehicles))
        if self._traffic is not None:
            with self._timed("traffic (SUMO)"):
                self._traffic.step(time, ego, before.pedestrians)
        with self._timed("pedestrians"):
            self._pedestrians.step(DT, [ego, *before.vehicles])
        with self._timed("contacts"):
            contacts = self._touch(before)
        here = self._ego.pose
        progress = self.route.line.project(here.x, here.y, near=before.progress).s
        self._look(time, progress, contacts)

    def displace(self, left: float, turn: float) -> None:
        """Puts the ego some metres to the left and turns it (rad)."""
        self._ego = replace(self._ego, pose=moved(self._ego.pose, left=left, turn=turn))
        self._look(self.moment.time, self.moment.progress, self.moment.contacts)

    def release(self) -> None:
        """Lets another episode of this process have SUMO."""
        if self._traffic is not None:
            self._traffic.release()

    def close(self) -> None:
        """Ends the simulation of the traffic."""
        if self._traffic is not None:
            self._traffic.close()

    def _ego_box(self) -> VehicleState:
        return VehicleState(self._ego.pose, self._ego.speed, self.vehicle.length, self.vehicle.width, "ego")

    def _touch(self, before: Moment) -> tuple[Contact, ...]:
        """Finds contacts, and lets them act on the ego."""
        ego = self._ego_box()
        x, y = ego.pose.x, ego.pose.y
        near = self.town.obstacles.near(x, y)
        for group in (before.vehicles, before.pedestrians):
            close = [one for one in group if abs(one.pose.x - x) + abs(one.pose.y - y) < CONTACT_REACH]
            near += [obstacle_of(one) for one in close]
        ego, contacts = resolve(ego, near)
        self._ego = replace(self._ego, pose=ego.pose, speed=ego.speed)
        return contacts

    def _look(self, time: float, progress: float, contacts: tuple[Contact, ...]) -> None:
        with self._timed("pedestrians"):
            people = self._pedestrians.states()
        with self._timed("lights"):
            lights = self._lights.shown()
        vehicles = self._traffic.cars if self._traffic is not None else ()
        self.moment = Moment(time, self._ego_box(), vehicles, people, lights, contacts, progress)
        with self._timed("labels and truth"):
            self.truth = self.labels.truth(self.moment)
