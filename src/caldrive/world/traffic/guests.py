"""Cars that others drive, as SUMO's cars see them: they come and go, and SUMO is told where they are."""

from __future__ import annotations

import math
from collections.abc import Iterable

import libsumo

from caldrive.datatypes import VehicleState
from caldrive.geometry import moved
from caldrive.world.roads.network import RoadNetwork

OFF_ROAD = 15.0  # m from every lane, where no car minds them any more: SUMO looks for their lane no farther away
ROUTE = "guests"  # a way of one edge that all guests pretend to be on


def move_in_sumo(name: str, car: VehicleState) -> None:
    """Puts a vehicle of the running simulation where it is now."""
    front = moved(car.pose, forward=car.length / 2)
    angle = 90.0 - math.degrees(car.pose.heading)
    libsumo.vehicle.moveToXY(name, "", -1, front.x, front.y, angle, keepRoute=2, matchThreshold=OFF_ROAD)


class Guests:
    """The guests of one simulation. known: the ids of those that it has."""

    def __init__(self, roads: RoadNetwork) -> None:
        self._roads = roads
        self._cars: dict[str, VehicleState] = {}
        self.known: set[str] = set()

    def update(self, cars: Iterable[VehicleState]) -> None:
        """These are the guests from the next step on, and this is where they are."""
        self._cars = {car.id: car for car in cars}

    def move(self) -> None:
        """Tells the running simulation."""
        present = set(libsumo.vehicle.getIDList()) | set(libsumo.simulation.getPendingVehicles())
        for name in sorted(self.known - self._cars.keys()):
            if name in present:
                libsumo.vehicle.remove(name)
        self.known = set(self._cars)
        for name, car in self._cars.items():
            if name not in present:
                self._add(name, car)
            move_in_sumo(name, car)

    def _add(self, name: str, car: VehicleState) -> None:
        if ROUTE not in libsumo.route.getIDList():
            libsumo.route.add(ROUTE, [self._roads.driveable[0].edge])
        libsumo.vehicle.add(name, ROUTE, departSpeed="0")
        libsumo.vehicle.setLength(name, car.length)
        libsumo.vehicle.setWidth(name, car.width)
