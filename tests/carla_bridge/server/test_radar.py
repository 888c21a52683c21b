"""A radar before a flat ground and a wall whose distances are known."""

from __future__ import annotations

import math

import numpy as np
import pytest

from caldrive.carla_bridge.axes import Placement
from caldrive.carla_bridge.server.radar import detections, radar_settings, velocities
from caldrive.datatypes import PedestrianState, Pose, VehicleState
from tests.carla_bridge.server.test_lidar import WALL, asked, rays


def test_a_radar_tells_how_fast_things_come_nearer() -> None:
    radar = radar_settings(asked(points_per_second="20000"))
    found = detections(radar, Placement(z=1.0), (3.0, 0.0), [], rays())
    ahead = np.abs(found[:, 1]) + np.abs(found[:, 2]) < 0.01
    assert ahead.any()
    assert found[ahead, 0] == pytest.approx(-3.0, abs=0.01)
    assert found[ahead, 3] == pytest.approx(WALL, rel=0.01)
    assert np.abs(found[:, 1:3]).max() < math.radians(15.2)
    leaving = VehicleState(Pose(WALL + 1.9, 0.0, 0.0), speed=5.0, length=4.0, width=8.0)
    found = detections(radar, Placement(z=1.0), (3.0, 0.0), [leaving], rays())
    ahead = np.abs(found[:, 1]) + np.abs(found[:, 2]) < 0.01
    assert found[ahead, 0] == pytest.approx(2.0, abs=0.01)


def test_a_point_moves_as_the_body_that_it_is_on() -> None:
    car = VehicleState(Pose(10.0, 0.0, math.pi / 2), speed=4.0, length=4.0, width=2.0)
    person = PedestrianState(Pose(0.0, 5.0, math.pi), speed=1.0, radius=0.3)
    points = np.array([(10.0, 1.9, 0.5), (12.0, 0.0, 0.5), (10.0, 1.9, 0.0), (0.2, 5.0, 1.0)])
    assert velocities(points, [car, person]) == pytest.approx(np.array([(0, 4), (0, 0), (0, 0), (-1, 0)]), abs=1e-9)
