"""Vehicles that clients drive: CARLA's controls on the bicycle model of the embedded world's ego."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import msgspec

from caldrive.carla_bridge.axes import Placement, standing, vector_to_carla
from caldrive.carla_bridge.server.actors import STILL, Actor
from caldrive.carla_bridge.server.friction import gripping, own_wheels, require_friction
from caldrive.carla_bridge.server.layouts import (
    AckermannControl,
    AckermannSettings,
    PhysicsControl,
    Vector,
    VehicleControl,
    Wheel,
)
from caldrive.carla_bridge.server.wire import Refusal
from caldrive.datatypes import Control, VehicleState
from caldrive.geometry import wrap_angle
from caldrive.world.traffic.ego import EgoState, VehicleConfig, advance

ROLLS = 0.1  # m/s from which on a vehicle has to stop before it drives the other way
ENGINE_BRAKE = 0.5  # of the brake: what a gear against the motion does
AXLES = 0.62  # of the length lie between them
FULL_THROTTLE, FULL_BRAKE = 3.0, 8.0  # m/s² that a whole pedal is worth to the Ackermann controller
CM = 100.0  # in a m
WIDEST = 80.0  # degrees that a wheel may turn


@dataclass(eq=False)
class Vehicle(Actor):
    """A vehicle on the ground."""

    config: VehicleConfig = VehicleConfig()
    state: EgoState = field(kw_only=True)
    control: VehicleControl = VehicleControl()
    ackermann: AckermannControl | None = None
    ackermann_settings: AckermannSettings = AckermannSettings()
    physics: PhysicsControl = PhysicsControl()
    has_physics: bool = True
    """Whether it drives by itself, not only where it is put."""
    collides: bool = True
    constant_speed: float | None = None
    """m/s that it is held at."""
    lights: int = 0
    limit: float = 30.0
    """km/h, the lawful one where it is."""
    has_gravity: bool = True
    """Whether its tyres are on the ground."""
    friction_here: float | None = None
    """That of its tyres in the volume that it is in, if any."""
    pushed: float = 0.0
    """N along its heading, for one step."""

    @property
    def place(self) -> Placement:
        """Where it is; what has no physics may hover, and what is below the ground stays there."""
        pose, own, is_held = self.state.pose, self.own_place, self.is_aside or not self.has_physics
        return replace(own, x=pose.x, y=pose.y, heading=pose.heading) if is_held else standing(pose)

    def put(self, place: Placement) -> None:
        """It is at a place from now on, and keeps its speed."""
        self.own_place = place
        self.state = replace(self.state, pose=place.pose)

    def box_state(self) -> VehicleState:
        """As the embedded world knows cars."""
        size, state = self.config, self.state
        name = f"{self.kind}#{self.id}"
        return VehicleState(state.pose, state.speed, length=size.length, width=size.width, id=name)

    def step(self, dt: float) -> None:
        """Drives on for dt seconds."""
        before = self.state
        if self.is_aside or not self.has_physics:
            self.state, self.motion = replace(before, speed=0.0, acceleration=0.0), STILL
            return
        if self.ackermann is not None:
            self.control = by_ackermann(self.ackermann, before, self.config)
        here = self.friction_here if self.has_gravity else 0.0
        self.state = drive(before, self.control, dt, gripping(self.config, self.physics, here))
        speed = self.state.speed + self.pushed / self.physics.mass * dt
        self.pushed = 0.0
        if self.description.get("sticky_control", "true").lower() == "false":
            self.control = VehicleControl()
        self.state = replace(self.state, speed=speed if self.constant_speed is None else self.constant_speed)

    def note_motion(self, before: EgoState, dt: float) -> None:
        """Takes down how it moves, from where it was dt seconds ago."""
        x, y = _velocity(self.state)
        x0, y0 = _velocity(before)
        turn = wrap_angle(self.state.pose.heading - before.pose.heading) / dt
        self.motion = (
            vector_to_carla(x, y), (0.0, 0.0, -math.degrees(turn)), vector_to_carla((x - x0) / dt, (y - y0) / dt),
        )  # fmt: skip

    def push(self, newtons: tuple[float, float]) -> None:
        """A force (N, in our axes) acts through the next step; only what is along its heading moves it."""
        heading = self.state.pose.heading
        self.pushed += newtons[0] * math.cos(heading) + newtons[1] * math.sin(heading)

    def kick(self, impulse: tuple[float, float]) -> None:
        """Likewise an impulse (N s), at once."""
        heading = self.state.pose.heading
        along = impulse[0] * math.cos(heading) + impulse[1] * math.sin(heading)
        self.state = replace(self.state, speed=self.state.speed + along / self.physics.mass)


def _velocity(state: EgoState) -> tuple[float, float]:
    return state.speed * math.cos(state.pose.heading), state.speed * math.sin(state.pose.heading)


def config_of(length: float, width: float) -> VehicleConfig:
    """The embedded world's ego, as long (m) and wide as another vehicle."""
    wheelbase = AXLES * length
    return replace(VehicleConfig(), length=length, width=width, wheelbase=wheelbase, front_axle=wheelbase / 2)


def drive(state: EgoState, control: VehicleControl, dt: float, config: VehicleConfig) -> EgoState:
    """The state dt seconds later. A negative speed is that of a vehicle that reverses."""
    brake = 1.0 if control.hand_brake else control.brake
    backwards = control.reverse if abs(state.speed) < ROLLS else state.speed < 0
    if backwards == control.reverse:
        wanted = Control(control.throttle, brake, -control.steer)
    else:  # the gear is against the motion
        wanted = Control(0.0, max(brake, ENGINE_BRAKE * control.throttle), -control.steer)
    return _advance_backwards(state, wanted, dt, config) if backwards else advance(_ahead(state), wanted, dt, config)


def _ahead(state: EgoState) -> EgoState:
    return state if state.speed >= 0 else replace(state, speed=0.0)


def _advance_backwards(state: EgoState, control: Control, dt: float, config: VehicleConfig) -> EgoState:
    """A vehicle that reverses is one that drives ahead the other way round and steers with its rear axle: the axle that
    rolls along the heading then lies before its centre."""
    turned = replace(
        state,
        pose=replace(state.pose, heading=wrap_angle(state.pose.heading + math.pi)),
        speed=max(0.0, -state.speed), steer_angle=-state.steer_angle,
    )  # fmt: skip
    mirrored = replace(config, front_axle=2 * config.wheelbase - config.front_axle)
    moved = advance(turned, replace(control, steer=-control.steer), dt, mirrored)
    return replace(
        moved,
        pose=replace(moved.pose, heading=wrap_angle(moved.pose.heading + math.pi)),
        speed=-moved.speed, steer_angle=-moved.steer_angle, acceleration=-moved.acceleration,
    )  # fmt: skip


def by_ackermann(wanted: AckermannControl, state: EgoState, config: VehicleConfig) -> VehicleControl:
    """The pedals and the wheel for a speed (m/s) and an angle of the wheels, at a limited acceleration where one is
    given."""
    most = wanted.acceleration if wanted.acceleration > 0 else FULL_THROTTLE
    error = abs(wanted.speed) - abs(state.speed)
    acceleration = max(-FULL_BRAKE, min(most, error))
    steer = max(-1.0, min(1.0, wanted.steer / config.max_steer))
    reverse = wanted.speed < 0
    if acceleration < 0 or wanted.speed == 0:
        return VehicleControl(0.0, steer, min(1.0, max(-acceleration / FULL_BRAKE, 0.1)), False, reverse)
    return VehicleControl(min(1.0, (acceleration + 0.3) / FULL_THROTTLE), steer, 0.0, False, reverse)


def physics_of(vehicle: Vehicle) -> PhysicsControl:
    """The physics of a vehicle: what a client set, and the wheels where they are now."""
    config, pose = vehicle.config, vehicle.state.pose
    c, s = math.cos(pose.heading), math.sin(pose.heading)
    rear = config.front_axle - config.wheelbase
    wheels = []
    for k, (ahead, left) in enumerate((x, y) for x in (config.front_axle, rear) for y in (0.45, -0.45)):
        x, y, z = vector_to_carla(
            pose.x + c * ahead - s * left * config.width, pose.y + s * ahead + c * left * config.width, 0.33
        )
        steers = math.degrees(config.max_steer) if k < 2 else 0.0
        wheel = vehicle.physics.wheels[k] if k < len(vehicle.physics.wheels) else Wheel()
        position = Vector(x * CM, y * CM, z * CM)
        friction = wheel.tire_friction if vehicle.friction_here is None else vehicle.friction_here
        wheels.append(msgspec.structs.replace(wheel, tire_friction=friction, max_steer_angle=steers, position=position))
    return msgspec.structs.replace(vehicle.physics, wheels=tuple(wheels))


def set_physics(vehicle: Vehicle, physics: PhysicsControl) -> None:
    """Takes over what the bicycle model has: the mass, the grip and the drag, and how far the front wheels turn.
    Raises Refusal where one of them cannot be."""
    require_friction(physics)
    if not physics.mass >= 1.0:
        raise Refusal(f"found a mass of {physics.mass} kg, wanted 1 kg at least: give another one")
    angles = [wheel.max_steer_angle for wheel in physics.wheels[:2]]
    if angles and not (all(0.0 <= angle <= WIDEST for angle in angles) and max(angles) >= 1.0):
        raise Refusal(f"found max_steer_angle {angles} of the front wheels, wanted 1 to {WIDEST:g} degrees: set others")
    if angles:
        vehicle.config = replace(vehicle.config, max_steer=math.radians(max(angles)))
    wheels = own_wheels(physics, vehicle.physics, vehicle.friction_here)
    vehicle.physics = msgspec.structs.replace(physics, wheels=wheels)
