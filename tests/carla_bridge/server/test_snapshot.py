"""The sizes and places of what the client reads from memory: another layout than CARLA 0.9.16's would end it."""

from __future__ import annotations

import struct

import pytest

from caldrive.carla_bridge.axes import Placement
from caldrive.carla_bridge.server import snapshot
from caldrive.carla_bridge.server.layouts import Vector, VehicleControl, WalkerControl
from caldrive.carla_bridge.server.snapshot import Sensor


def test_a_header_says_which_sensor_when_and_where() -> None:
    packed = snapshot.header(Sensor.RGB, frame=5, time=0.5, place=Placement(1.0, 2.0, 3.0))
    assert len(packed) == 48
    assert struct.unpack("<QQd6f", packed) == (13, 5, 0.5, 1.0, -2.0, 3.0, 0.0, 0.0, 0.0)


def test_a_snapshot_begins_with_36_bytes_and_has_119_for_each_actor() -> None:
    assert len(snapshot.world_head(1, 0.0, 0.1)) == 36
    motion = ((1.0, 2.0, 3.0), (4.0, 5.0, 6.0), (7.0, 8.0, 9.0))
    row = snapshot.actor_row(300, Placement(1.0, 2.0), motion, b"rest")
    assert len(row) == 119
    assert struct.unpack_from("<IB", row) == (300, 1)
    assert struct.unpack_from("<9f", row, 29) == (1, 2, 3, 4, 5, 6, 7, 8, 9)
    assert row[65:69] == b"rest"


def test_a_vehicle_says_what_it_does_and_at_which_light_it_is() -> None:
    control = VehicleControl(0.5, -0.25, 0.75, hand_brake=True, gear=2)
    packed = snapshot.vehicle_part(control, 30.0, light=(2, 77))
    assert struct.unpack_from("<3f", packed) == (0.5, -0.25, 0.75)
    assert struct.unpack_from("<3B", packed, 12) == (1, 0, 0)
    assert struct.unpack_from("<if", packed, 15) == (2, 30.0)
    assert struct.unpack_from("<BBI", packed, 23) == (2, 1, 77)


def test_a_walker_and_a_light_fit_in_what_an_actor_adds() -> None:
    assert struct.unpack("<4fB", snapshot.walker_part(WalkerControl(Vector(1, 0, 0), 1.5))) == (1, 0, 0, 1.5, 0)
    light = snapshot.light_part("sign", (10.0, 3.0, 2.0), 1.0, 4, is_frozen=True, state=2)
    assert len(light) == 54
    assert light[:5] == b"sign\0"
    assert struct.unpack_from("<I2B", light, 48) == (4, 1, 2)


@pytest.mark.parametrize(("sensor", "number"), [(Sensor.WORLD, 17), (Sensor.DEPTH, 1), (Sensor.IMU, 5)])
def test_sensors_have_the_numbers_of_0_9_16(sensor: Sensor, number: int) -> None:
    assert sensor == number
