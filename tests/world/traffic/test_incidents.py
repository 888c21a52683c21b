"""Incidents: what happens to the car ahead, and to no other."""

from __future__ import annotations

import numpy as np
import pytest

from caldrive.datatypes import Pose, VehicleState
from caldrive.world.traffic.incidents import HARD_BRAKE, Incident, Incidents, _next_ahead

EGO = VehicleState(Pose(0, 0, 0), 5.5, length=4.2, width=1.8, id="ego")


def car(x: float, y: float = 0.0, heading: float = 0.0, speed: float = 5.0, name: str = "car") -> VehicleState:
    return VehicleState(Pose(x, y, heading), speed, length=4.2, width=1.8, id=name)


def test_it_happens_to_the_car_next_ahead() -> None:
    assert _next_ahead(EGO, [car(30, name="far"), car(15, name="near")]) == car(15, name="near")


@pytest.mark.parametrize("other", [car(-15), car(15, y=3.5), car(15, heading=3.1), car(15, speed=0.5), car(60), car(6)])
def test_it_happens_to_nobody_else(other: VehicleState) -> None:
    assert _next_ahead(EGO, [other]) is None


def test_a_car_that_brakes_hard_stops_by_its_brake_and_drives_on_later() -> None:
    incident = Incident("car", brake=HARD_BRAKE, since=10.0, speed=7.0, stands=2.0)
    assert [incident.allowed(time) for time in (10.0, 10.5, 11.0, 12.0)] == [7.0, 3.5, 0.0, 0.0]
    assert not incident.is_over(12.9)
    assert incident.is_over(13.1)


def test_incidents_come_at_their_rate_one_after_the_other() -> None:
    incidents, began = Incidents(np.random.default_rng(0)), []
    for k in range(20_000):
        before = incidents.current
        now = incidents.step(0.1 * k, 0.1, EGO, [car(15)])
        if now is not None and now is not before:
            began.append(now)
    assert 20 < len(began) < 45, "one in 40 s, while there is none"
    assert {incident.brake for incident in began} == {7.0, 2.5}
    ends = [incident.since + incident.stands for incident in began]
    assert all(later.since > end for later, end in zip(began[1:], ends, strict=False))
