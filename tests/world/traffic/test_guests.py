"""Cars that others drive, as SUMO's cars see them."""

from __future__ import annotations

import numpy as np
import pytest

from caldrive.datatypes import VehicleState
from caldrive.geometry import boxes_of, to_local
from caldrive.world.roads.network import RoadNetwork
from caldrive.world.traffic.traffic_lights import TrafficLights
from caldrive.world.traffic.vehicles import Traffic

DT = 0.1


@pytest.mark.usefixtures("no_sumo_left")
def test_cars_stop_behind_a_guest_and_drive_on_when_it_has_gone(town01: RoadNetwork) -> None:
    lights = TrafficLights(town01, np.random.default_rng(0))
    traffic = Traffic(town01, n=30, seed=1, dt=DT, ego=None, lights=lights)
    places = {car.id: town01.lane_at(car.pose) for car in traffic.cars}
    name = next(name for name, (lane, s) in places.items() if lane.line.length - s > 45.0)
    lane, s = places[name]
    guest = VehicleState(lane.line.pose_at(s + 35.0), id="guest")
    for k in range(200):
        traffic.guests.update([guest])
        traffic.step(k * DT, None, ())
    first = next(car for car in traffic.cars if car.id == name)
    behind = -float(to_local(guest.pose, np.array((first.pose.x, first.pose.y)))[0])
    assert guest.id not in {car.id for car in traffic.cars}
    assert first.speed < 0.5
    assert 4.0 < behind < 35.0
    for k in range(200, 260):
        traffic.guests.update([])
        lights.step(k * DT, boxes_of(traffic.cars))
        traffic.step(k * DT, None, ())
    now = next(car for car in traffic.cars if car.id == name)
    assert np.hypot(now.pose.x - first.pose.x, now.pose.y - first.pose.y) > 5.0
    traffic.close()
