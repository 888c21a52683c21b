"""The calls about vehicles and walkers."""

from __future__ import annotations

import math
from typing import Any

import msgspec

from caldrive.carla_bridge.server.actor_calls import ActorCalls, finite
from caldrive.carla_bridge.server.actors import Actor
from caldrive.carla_bridge.server.calls import call
from caldrive.carla_bridge.server.layouts import (
    AckermannControl,
    AckermannSettings,
    PhysicsControl,
    Transform,
    Vector,
    VehicleControl,
    WalkerControl,
    Wheel,
    placement,
)
from caldrive.carla_bridge.server.server import Server
from caldrive.carla_bridge.server.vehicles import Vehicle, physics_of, set_physics
from caldrive.carla_bridge.server.walkers import FASTEST, Walker
from caldrive.carla_bridge.server.wire import Refusal


class VehicleCalls:
    """They answer from one server; actors: finds them."""

    def __init__(self, server: Server, actors: ActorCalls) -> None:
        self._server, self._actors = server, actors

    def _vehicle(self, number: int) -> Vehicle:
        return self._actors.find(number, Vehicle)

    def _any_vehicle(self, number: int) -> Actor:
        """A client's vehicle, or one of the town's own. Raises Refusal where it is none."""
        found = self._server.episode.get(number)
        return found if found and found.kind.startswith("vehicle.") else self._vehicle(number)

    @call("apply_control_to_vehicle")
    def control(self, caller: int, number: int, control: VehicleControl) -> None:
        """It holds until the next one."""
        vehicle = self._vehicle(number)
        vehicle.ackermann = None
        vehicle.control = msgspec.structs.replace(
            control, throttle=max(0.0, finite(control.throttle, 1.0)), steer=finite(control.steer, 1.0),
            brake=max(0.0, finite(control.brake, 1.0)), gear=int(finite(control.gear, 100)),
        )  # fmt: skip

    @call("apply_ackermann_control_to_vehicle")
    def ackermann(self, caller: int, number: int, control: AckermannControl) -> None:
        """A speed and an angle of the wheels."""
        names = ("steer", "steer_speed", "speed", "acceleration", "jerk")
        values = (finite(getattr(control, name), 1e3) for name in names)
        self._vehicle(number).ackermann = AckermannControl(*values)

    @call("get_ackermann_controller_settings")
    def ackermann_settings(self, caller: int, number: int) -> AckermannSettings:
        """As they were set."""
        return self._vehicle(number).ackermann_settings

    @call("apply_ackermann_controller_settings")
    def set_ackermann_settings(self, caller: int, number: int, settings: AckermannSettings) -> None:
        """They are kept and read back; the controller has gains of its own."""
        self._vehicle(number).ackermann_settings = settings

    @call("get_physics_control")
    def physics(self, caller: int, number: int) -> PhysicsControl:
        """With the constants of the bicycle model."""
        found = self._any_vehicle(number)
        return physics_of(found) if isinstance(found, Vehicle) else PhysicsControl(wheels=(Wheel(),) * 4)

    @call("apply_physics_control")
    def set_physics(self, caller: int, number: int, physics: PhysicsControl) -> None:
        """Mass, friction, drag and steering count; the rest is read back."""
        set_physics(self._vehicle(number), physics)

    @call("get_vehicle_light_state")
    def vehicle_lights(self, caller: int, number: int) -> tuple[int]:
        """As they were set."""
        found = self._any_vehicle(number)
        return (found.lights if isinstance(found, Vehicle) else 0,)

    @call("set_vehicle_light_state")
    def set_vehicle_lights(self, caller: int, number: int, flags: tuple[int]) -> None:
        """They are not drawn."""
        self._vehicle(number).lights = flags[0] & 0xFFFFFFFF

    @call("get_vehicle_light_states")
    def all_vehicle_lights(self, caller: int) -> list[tuple[int, int]]:
        """Of all vehicles of clients."""
        return [(one.id, one.lights) for one in self._server.episode.all(Vehicle)]

    @call("get_telemetry_data")
    def telemetry(self, caller: int, number: int) -> tuple[Any, ...]:
        """Speed and pedals; a bicycle model knows nothing of its wheels."""
        vehicle, wheels = self._any_vehicle(number), [(0.0,) * 11 for _ in range(4)]
        control = vehicle.control if isinstance(vehicle, Vehicle) else VehicleControl()
        return math.hypot(*vehicle.motion[0]), control.steer, control.throttle, control.brake, 0.0, 1, 0.3, wheels

    @call("get_wheel_steer_angle")
    def wheel_angle(self, caller: int, number: int, wheel: int) -> float:
        """Degrees to the right."""
        return -math.degrees(self._vehicle(number).state.steer_angle) if wheel < 2 else 0.0

    @call("set_wheel_steer_direction")
    def set_wheel_angle(self, caller: int, number: int, wheel: int, angle: float) -> None:
        """Wheels turn with the steering alone."""

    @call("get_wheel_pitch_angle")
    def wheel_pitch(self, caller: int, number: int, wheel: int) -> float:
        """Wheels are drawn as they are."""
        return 0.0

    @call("set_wheel_pitch_angle")
    def set_wheel_pitch(self, caller: int, number: int, wheel: int, angle: float) -> None:
        """Likewise."""

    @call("set_actor_autopilot")
    def autopilot(self, caller: int, number: int, is_on: bool) -> None:
        """The client's own traffic manager drives."""

    @call("open_vehicle_door")
    @call("close_vehicle_door")
    def door(self, caller: int, number: int, door: int) -> None:
        """Doors stay closed."""

    @call("show_vehicle_debug_telemetry")
    def debug_telemetry(self, caller: int, number: int, is_on: bool) -> None:
        """There is no screen."""

    @call("apply_control_to_walker")
    def walk(self, caller: int, number: int, control: WalkerControl) -> None:
        """It holds until the next one."""
        d = control.direction
        direction = Vector(finite(d.x, 1e3), finite(d.y, 1e3), finite(d.z, 1e3))
        walker = self._actors.find(number, Walker)
        walker.control = WalkerControl(direction, finite(control.speed, FASTEST), control.jump)

    def follow_crowd(self, number: int, at: Transform, speed: float) -> None:
        """The client's crowd moves a walker."""
        self._actors.find(number, Walker).follow(placement(at), finite(speed, FASTEST))

    @call("get_bones_transform")
    def bones(self, caller: int, number: int) -> tuple[list[Any]]:
        """None: people are drawn as they are."""
        return ([],)

    @call("set_bones_transform")
    def set_bones(self, caller: int, number: int, bones: Any) -> None:
        """Likewise."""

    @call("blend_pose")
    def blend_pose(self, caller: int, number: int, share: float) -> None:
        """Likewise."""

    @call("get_pose_from_animation")
    def pose_from_animation(self, caller: int, number: int) -> None:
        """Likewise."""

    def _refuse_model(self) -> None:
        """Raises Refusal: there is one model of a vehicle."""
        raise Refusal("found a vehicle model of CARLA's own, wanted the bicycle model that caldrive has: leave it out")

    @call("enable_carsim")
    def carsim(self, caller: int, number: int, file: str = "") -> None:
        """Not here."""
        self._refuse_model()

    @call("use_carsim_road")
    def carsim_road(self, caller: int, number: int, is_on: bool = False) -> None:
        """Not here."""
        self._refuse_model()

    @call("enable_chrono_physics")
    def chrono(
        self, caller: int, number: int, substeps: int = 0, step: float = 0.0, vehicle: str = "", power: str = "",
        tire: str = "", base: str = "",
    ) -> None:  # fmt: skip
        """Not here."""
        self._refuse_model()

    @call("restore_physx_physics")
    def physx(self, caller: int, number: int) -> None:
        """There is one model only."""
