"""Who lives in the town beside the clients' actors: SUMO's cars, people, and the lights that they obey.

They move in steps of 0.1 s, as in the embedded world, whatever steps a client asks for: between two of theirs, everyone
is on the straight way from one place to the next.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import TypeVar

import numpy as np

from caldrive.datatypes import DT, PedestrianState, Pose, VehicleState
from caldrive.geometry import boxes_of, wrap_angle
from caldrive.world.roads.network import RoadNetwork
from caldrive.world.traffic import sidewalks
from caldrive.world.traffic.pedestrians import Pedestrians
from caldrive.world.traffic.start_places import free_places
from caldrive.world.traffic.traffic_lights import TrafficLights
from caldrive.world.traffic.vehicles import Traffic

UNSEEN_DEMAND = 1 / 45  # 1/s: how often somebody comes to a light where no cars drive
LONGEST_STEP = 8.0  # m in 0.1 s; who moves farther was put elsewhere
SAME_TIME = 1e-6  # s
Moving = TypeVar("Moving", VehicleState, PedestrianState)


class Population:
    """Cars and people by number, from one seed. Raises ValueError for more than the town holds."""

    def __init__(self, roads: RoadNetwork, cars: int, people: int, seed: int) -> None:
        for_lights, for_people, for_cars = (np.random.default_rng([seed, k]) for k in range(3))
        self.lights = TrafficLights(roads, for_lights, demand=0.0 if cars else UNSEEN_DEMAND)
        self._people = Pedestrians(roads, people, for_people)
        self._traffic: Traffic | None = None
        if cars:
            seed = int(for_cars.integers(2**31))
            self._traffic = Traffic(roads, n=cars, seed=seed, dt=DT, ego=None, lights=self.lights)
        self._time = 0.0
        self._cars: tuple[VehicleState, ...] = self._traffic.cars if self._traffic else ()
        self._walkers = self._people.states()
        self._before = self._cars, self._walkers

    def move_to(self, time: float, guests: Sequence[VehicleState], walkers: Sequence[PedestrianState]) -> None:
        """Moves everyone on until a time (s) is reached. guests, walkers: the clients'."""
        while self._time < time - SAME_TIME:
            self._time = round(self._time + DT, 6)
            before = self._cars, self._walkers
            boxes = boxes_of((*guests, *self._cars))
            self.lights.step(self._time, boxes)
            if self._traffic is not None:
                self._traffic.guests.update(guests)
                self._traffic.step(self._time, None, [*self._walkers, *walkers])
                self._cars = self._traffic.cars
            self._people.step(DT, boxes)
            self._walkers = self._people.states()
            self._before = before

    def at(self, time: float) -> tuple[list[VehicleState], list[PedestrianState]]:
        """Where everyone is at a time (s) of the last 0.1 s."""
        share = min(max(1 - (self._time - time) / DT, 0.0), 1.0)
        if share > 1 - SAME_TIME:
            return list(self._cars), list(self._walkers)
        cars, walkers = self._before
        return list(_between(cars, self._cars, share)), list(_between(walkers, self._walkers, share))

    def close(self) -> None:
        """Ends the simulation of the cars."""
        if self._traffic is not None:
            self._traffic.close()


def require_room(roads: RoadNetwork, cars: int, people: int) -> None:
    """Raises ValueError for more cars or people than there is room for."""
    sidewalks.require_room(roads, people)
    free_places(roads, cars, None)


def _between(before: Sequence[Moving], after: Sequence[Moving], share: float) -> Iterator[Moving]:
    """Everyone on their way from one place to the next."""
    known = {one.id: one for one in before}
    for one in after:
        start = known.get(one.id, one)
        (a, b) = start.pose, one.pose
        if abs(a.x - b.x) + abs(a.y - b.y) > LONGEST_STEP:
            a = b
        turn = wrap_angle(b.heading - a.heading)
        pose = Pose(a.x + share * (b.x - a.x), a.y + share * (b.y - a.y), a.heading + share * turn)
        yield replace(one, pose=pose)
