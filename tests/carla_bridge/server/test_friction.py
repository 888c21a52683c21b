"""How tyres hold, in manoeuvres."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import msgspec
import pytest

from caldrive.carla_bridge.axes import Placement
from caldrive.carla_bridge.server.actors import description
from caldrive.carla_bridge.server.friction import FrictionVolume, friction_at, volume
from caldrive.carla_bridge.server.layouts import PhysicsControl, VehicleControl, Wheel
from caldrive.carla_bridge.server.server import Server
from caldrive.carla_bridge.server.settings import ServerSettings
from caldrive.carla_bridge.server.vehicles import Vehicle, physics_of, set_physics
from caldrive.carla_bridge.server.wire import Refusal
from caldrive.commands.serve_carla import make_server
from caldrive.datatypes import Pose
from caldrive.world.traffic.ego import EgoState
from tests.carla_bridge.server.wire_client import WireClient, free_port

FAST = 100 / 3.6  # m/s


def vehicle(friction: float = 3.5, drag: float = 0.3, speed: float = FAST) -> Vehicle:
    car = Vehicle(1, description("vehicle.audi.tt"), Placement(), state=EgoState(Pose(0.0, 0.0, 0.0), speed))
    set_physics(car, PhysicsControl(wheels=(Wheel(tire_friction=friction),) * 4, drag=drag))
    return car


def after(car: Vehicle, control: VehicleControl, seconds: float) -> EgoState:
    car.control = control
    for _ in range(round(seconds / 0.05)):
        car.step(0.05)
    return car.state


COAST, BRAKE = VehicleControl(), VehicleControl(brake=1.0)


def test_on_ice_without_drag_nothing_changes_how_a_vehicle_moves() -> None:
    for control in (COAST, BRAKE, VehicleControl(throttle=1.0, steer=0.5)):
        state = after(vehicle(friction=0.0, drag=0.0), control, 5.0)
        assert state.speed == pytest.approx(FAST, abs=1e-3)
        assert state.pose.y == pytest.approx(0.0, abs=1e-3)


def test_the_usual_numbers_are_those_of_the_ego() -> None:
    assert after(vehicle(), BRAKE, 2.0) == after(Vehicle(1, description("vehicle.audi.tt"), Placement(),
        state=EgoState(Pose(0.0, 0.0, 0.0), FAST)), BRAKE, 2.0)  # fmt: skip


def test_less_friction_brakes_and_turns_less_and_more_brakes_more() -> None:
    ways = [after(vehicle(friction), BRAKE, 6.0).pose.x for friction in (1.0, 3.5, 5.0)]
    assert ways[0] > 1.5 * ways[1] > 1.5 * ways[2]
    turned = [after(vehicle(friction), VehicleControl(steer=-0.5), 1.0).pose.heading for friction in (1.0, 3.5)]
    assert turned[0] < 0.5 * turned[1]


def test_more_drag_slows_down_more() -> None:
    speeds = [after(vehicle(drag=drag), COAST, 5.0).speed for drag in (0.0, 0.3, 3.0)]
    assert speeds[0] > speeds[1] > speeds[2] + 1.0


def test_tyres_of_a_vehicle_without_gravity_do_not_hold() -> None:
    car = vehicle(drag=0.0)
    car.has_gravity = False
    assert after(car, BRAKE, 2.0).speed == pytest.approx(FAST)


def asked(**attributes: str) -> FrictionVolume:
    return volume(description("static.trigger.friction", **attributes), Placement(x=50.0, heading=math.pi / 2))


def test_a_volume_has_its_friction_inside_and_its_extent_along_itself() -> None:
    box = asked(friction="5.0", extent_x="4500", extent_y="300", extent_z="700")
    assert friction_at(Placement(x=52.0, y=40.0), [box]) == 5.0
    assert friction_at(Placement(x=55.0, y=40.0), [box]) is None
    assert friction_at(Placement(x=52.0, y=50.0), [box]) is None
    assert friction_at(Placement(x=52.0, y=40.0, z=8.0), [box]) is None


def test_the_friction_of_a_volume_is_read_back_from_the_wheels_and_brakes() -> None:
    car = vehicle(friction=0.0, drag=0.0)
    car.friction_here = 5.0
    assert [wheel.tire_friction for wheel in physics_of(car).wheels] == [5.0] * 4
    assert after(car, BRAKE, 1.0).speed < FAST - 5.0
    car.friction_here = None
    assert [wheel.tire_friction for wheel in physics_of(car).wheels] == [0.0] * 4


def test_who_gives_back_what_it_read_in_a_volume_has_its_own_friction_behind_it() -> None:
    car = vehicle(friction=1.0)
    car.friction_here = 3.1
    set_physics(car, msgspec.structs.replace(physics_of(car), mass=900.0))
    car.friction_here = None
    assert [wheel.tire_friction for wheel in physics_of(car).wheels] == [1.0] * 4
    assert car.physics.mass == 900.0


@pytest.mark.parametrize("mass", [0.0, math.nan])
def test_a_mass_that_cannot_be_is_refused_and_changes_nothing(mass: float) -> None:
    car, steer = vehicle(), vehicle().config.max_steer
    with pytest.raises(Refusal, match="found a mass"):
        set_physics(car, PhysicsControl(mass=mass, wheels=(Wheel(max_steer_angle=70.0),) * 4))
    assert car.config.max_steer == steer


@pytest.mark.parametrize("angles", [(0.0, 0.0), (90.0, 70.0), (math.nan, 70.0), (-5.0, 70.0)])
def test_wheels_that_cannot_turn_so_far_are_refused_and_nothing_changes(angles: tuple[float, float]) -> None:
    car, steer = vehicle(), vehicle().config.max_steer
    with pytest.raises(Refusal, match="max_steer_angle"):
        set_physics(car, PhysicsControl(wheels=tuple(Wheel(max_steer_angle=angle) for angle in angles)))
    assert car.config.max_steer == steer
    set_physics(car, PhysicsControl(wheels=(Wheel(max_steer_angle=50.0), Wheel(max_steer_angle=70.0))))
    assert car.config.max_steer == pytest.approx(math.radians(70.0))


@pytest.fixture(scope="module")
def server() -> Iterator[Server]:
    made = make_server(ServerSettings(town="town01", port=free_port()))
    yield made
    made.close()


def test_a_client_drives_through_a_volume_of_ice_and_loses_its_gravity(server: Server) -> None:
    client = WireClient(server)
    client.synchronous()
    (x, y, _), (_, yaw, _) = client.call("get_map_info")[1][0]
    number = client.spawn("vehicle.tesla.model3", (x, y, yaw))
    client.spawn("static.trigger.friction", (x, y, yaw), friction="0.0", extent_x="400", extent_y="400", extent_z="400")
    car = server.episode.get(number)
    assert isinstance(car, Vehicle)
    car.state, car.control = replace(car.state, speed=8.0), VehicleControl(brake=1.0)
    client.call("tick_cue")
    assert car.state.speed > 7.9
    assert client.call("get_physics_control", number)[-2][0][0] == 0.0  # tire_friction of the first wheel
    for _ in range(12):
        client.call("tick_cue")
    assert car.friction_here is None
    assert car.state.speed < 7.0
    car.state = replace(car.state, speed=8.0, brake_response=0.0)
    client.call("set_actor_enable_gravity", number, False)
    client.call("tick_cue")
    assert car.state.speed > 7.9
    client.leave()


@pytest.mark.parametrize(
    "physics", [PhysicsControl(drag=math.nan), PhysicsControl(wheels=(Wheel(tire_friction=-1.0),))]
)
def test_friction_that_cannot_be_is_refused(physics: PhysicsControl) -> None:
    car = vehicle()
    with pytest.raises(Refusal, match="wanted a number from 0"):
        set_physics(car, physics)
    assert car.physics.drag == 0.3


def test_a_volume_of_no_number_is_refused() -> None:
    with pytest.raises(Refusal, match="extent_x"):
        asked(extent_x="wide")
