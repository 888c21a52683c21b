"""The values of CARLA 0.9.16's protocol: msgpack arrays whose elements stand in the order of these fields.

Lengths in m, angles in degrees, axes CARLA's (`carla_bridge.axes`), unless a field says otherwise.
"""

from __future__ import annotations

import math

from msgspec import Struct

from caldrive.carla_bridge.axes import Placement, from_carla, to_carla
from caldrive.carla_bridge.server.wire import Refusal

Maybe = tuple[bool | float, ...]
"""`(False,)` for nothing, `(True, value)` for a value."""


Row = tuple[float, ...]


class Layout(Struct, array_like=True, frozen=True):
    """A value that travels as an array."""


class Vector(Layout, frozen=True):
    """A place or a direction."""

    x: float = 0.0
    y: float = 0.0
    z: float = 0.0


class Rotation(Layout, frozen=True):
    """In this order."""

    pitch: float = 0.0
    yaw: float = 0.0
    roll: float = 0.0


class Transform(Layout, frozen=True):
    """A place and how something is turned there."""

    location: Vector = Vector()
    rotation: Rotation = Rotation()


class BoundingBox(Layout, frozen=True):
    """Relative to its actor."""

    location: Vector = Vector()
    extent: Vector = Vector()
    """Half its sizes."""
    rotation: Rotation = Rotation()
    actor: int = 0


class AttributeValue(Layout, frozen=True):
    """What a client chose."""

    id: str
    type: int
    value: str


class ActorDescription(Layout, frozen=True):
    """What a client asks for."""

    uid: int
    id: str
    attributes: tuple[AttributeValue, ...] = ()

    def get(self, name: str, default: str = "") -> str:
        """An attribute's value."""
        return next((attribute.value for attribute in self.attributes if attribute.id == name), default)

    def number(self, name: str, default: float, low: float, high: float) -> float:
        """An attribute as a number. Raises Refusal where it is none, or out of range."""
        text = self.get(name, str(default))
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not low <= value <= high:
            raise Refusal(f"found {name} {text!r} of {self.id}, wanted {low:g} to {high:g}: set another value")
        return value


class Settings(Layout, frozen=True):
    """EpisodeSettings."""

    synchronous: bool = False
    no_rendering: bool = False
    fixed_delta: Maybe = (False,)
    substepping: bool = True
    max_substep_delta: float = 0.01
    max_substeps: int = 10
    max_culling: float = 0.0
    deterministic_ragdolls: bool = True
    tile_stream: float = 3000.0
    actor_active: float = 2000.0
    spectator_as_ego: bool = True

    @property
    def delta(self) -> float | None:
        """s of a step, None for a step that follows the clock."""
        match self.fixed_delta:
            case (True, float() | int() as seconds) if seconds:
                return float(seconds)
        return None


class VehicleControl(Layout, frozen=True):
    """steer: + to the right."""

    throttle: float = 0.0
    steer: float = 0.0
    brake: float = 0.0
    hand_brake: bool = False
    reverse: bool = False
    manual_gear_shift: bool = False
    gear: int = 0


class AckermannControl(Layout, frozen=True):
    """steer in rad, + to the right."""

    steer: float = 0.0
    steer_speed: float = 0.0
    speed: float = 0.0
    acceleration: float = 0.0
    jerk: float = 0.0


class AckermannSettings(Layout, frozen=True):
    """Gains of the controller behind an AckermannControl."""

    speed_kp: float = 0.15
    speed_ki: float = 0.0
    speed_kd: float = 0.25
    accel_kp: float = 0.01
    accel_ki: float = 0.0
    accel_kd: float = 0.01


class WalkerControl(Layout, frozen=True):
    """direction: in the world; speed in m/s."""

    direction: Vector = Vector(1.0)
    speed: float = 0.0
    jump: bool = False


class Weather(Layout, frozen=True):
    """CARLA's, in percent and degrees."""

    cloudiness: float = 5.0
    precipitation: float = 0.0
    precipitation_deposits: float = 0.0
    wind_intensity: float = 10.0
    sun_azimuth: float = 0.0
    sun_altitude: float = 45.0
    fog_density: float = 2.0
    fog_distance: float = 0.75
    fog_falloff: float = 0.1
    wetness: float = 0.0
    scattering_intensity: float = 1.0
    mie_scattering_scale: float = 0.03
    rayleigh_scattering_scale: float = 0.0331
    dust_storm: float = 0.0


class Wheel(Layout, frozen=True):
    """Radius and position in cm, the position in the world."""

    tire_friction: float = 3.5
    damping_rate: float = 0.25
    max_steer_angle: float = 35.0
    radius: float = 33.0
    max_brake_torque: float = 1500.0
    max_handbrake_torque: float = 3000.0
    lateral_stiffness_max_load: float = 2.0
    lateral_stiffness: float = 17.0
    longitudinal_stiffness: float = 1000.0
    position: Vector = Vector()


class PhysicsControl(Layout, frozen=True):
    """VehiclePhysicsControl; mass in kg."""

    torque_curve: tuple[Row, ...] = ((0.0, 400.0), (5000.0, 400.0))
    max_rpm: float = 5000.0
    moment_of_inertia: float = 1.0
    damping_full_throttle: float = 0.15
    damping_clutch_engaged: float = 2.0
    damping_clutch_disengaged: float = 0.35
    use_gear_autobox: bool = True
    gear_switch_time: float = 0.5
    clutch_strength: float = 10.0
    final_ratio: float = 4.0
    gears: tuple[Row, ...] = ()
    mass: float = 1400.0
    drag: float = 0.3
    center_of_mass: Vector = Vector()
    steering_curve: tuple[Row, ...] = ((0.0, 1.0), (120.0, 1.0))
    wheels: tuple[Wheel, ...] = ()
    use_sweep_wheel_collision: bool = False


def placement(transform: Transform) -> Placement:
    """A transform in our axes. Raises Refusal where a number is none."""
    at, turned = transform.location, transform.rotation
    numbers = (at.x, at.y, at.z, turned.pitch, turned.yaw, turned.roll)
    if not all(abs(number) < 1e7 for number in numbers):
        raise Refusal(f"found a place at {numbers}, wanted finite numbers within 10,000 km: give another transform")
    return from_carla(*numbers)


def transform(place: Placement) -> Transform:
    """A place in CARLA's axes."""
    x, y, z, pitch, yaw, roll = to_carla(place)
    return Transform(Vector(x, y, z), Rotation(pitch, yaw, roll))
