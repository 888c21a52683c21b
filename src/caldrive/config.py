"""Settings as frozen dataclasses. Presets are instances; nothing here computes."""

from __future__ import annotations

from dataclasses import dataclass

KMH = 1 / 3.6  # m/s in a km/h


@dataclass(frozen=True)
class CameraConfig:
    """A pinhole camera on the ego: image size in pixels, horizontal field of view in degrees, mounting in the car's frame.

    forward, left, up: metres from the car's centre at ground level; yaw: rad, + left. The default is the authors' 800 x 600
    camera with rows 120-480 kept, rendered straight at the network's size.
    """

    width: int = 200
    height: int = 88
    fov: float = 90.0
    forward: float = 1.44
    left: float = 0.0
    up: float = 1.2
    yaw: float = 0.0


@dataclass(frozen=True)
class VehicleConfig:
    """The ego: a compact car. Angles in rad, accelerations in m/s², times in s, mass in kg."""

    length: float = 4.2
    width: float = 1.8
    wheelbase: float = 2.6
    front_axle: float = 1.3  # m ahead of the centre
    max_steer: float = 0.6109  # 35°
    steer_rate: float = 2.0
    max_acceleration: float = 4.2
    max_brake: float = 8.0
    top_speed: float = 45.0
    throttle_lag: float = 0.25
    brake_lag: float = 0.08
    drag: float = 0.004
    rolling: float = 0.25
    mass: float = 1400.0
