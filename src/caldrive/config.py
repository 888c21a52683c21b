"""Settings as frozen dataclasses. Presets are instances; nothing here computes."""

from __future__ import annotations

from dataclasses import dataclass

KMH = 1 / 3.6  # m/s in a km/h
MOST_PIXELS = 4096  # a side of an image


@dataclass(frozen=True)
class CameraConfig:
    """A pinhole camera on the ego: image size in pixels, horizontal field of view in degrees, mounting.

    forward, left, up: metres from the car's centre at ground level; yaw: rad, + left. The default is the authors'
    800 x 600 camera with rows 120-480 kept, rendered straight at the network's size.
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
    max_acceleration: float = 3.8  # at standstill; the thrust falls evenly to 0 at top_speed
    max_brake: float = 8.0
    top_speed: float = 45.0
    throttle_lag: float = 0.25
    brake_lag: float = 0.08
    max_lateral: float = 8.0  # m/s², what the tyres give before the car understeers
    drag: float = 0.0008  # 1/m
    rolling: float = 0.25
    mass: float = 1400.0


@dataclass(frozen=True)
class PIDGains:
    """Parallel form: kp per unit of error, ki per unit and second, kd in seconds per unit.

    low, high: limits of the output. filter_time: time constant in s of the low pass on the derivative.
    """

    kp: float
    ki: float
    kd: float = 0.0
    low: float = -1.0
    high: float = 1.0
    filter_time: float = 0.2


@dataclass(frozen=True)
class LongitudinalConfig:
    """The five states' thresholds and laws. Speeds in km/h, distances in m, patience and red_roll in s; see
    control/presets.py for the reasons."""

    cruise: PIDGains = PIDGains(0.09, 0.02, 0.0, low=-0.3)
    follow: PIDGains = PIDGains(0.09, 0.01, 0.0)
    turn_reduction: float = 0.0
    turn_speed: float = 15.0
    follow_distance: float = 45.0
    follow_c: float = 3.0
    follow_d: float = 0.0
    follow_gap: float = 5.5
    over_limit_margin: float = 3.0
    over_limit_ratio: float = 0.0
    over_limit_gain: float = 0.03
    red_threshold: float = 0.5
    red_gain: float = 1.5
    red_floor: float = 0.8
    hazard_threshold: float = 0.4
    hazard_patience: float = 15.0
    red_patience: float = 25.0
    red_roll: float = 1.2
    red_rolls: int = 2
    creep_speed: float = 4.0
    hold_speed: float = 1.0
    hold_brake: float = 0.3


@dataclass(frozen=True)
class LateralConfig:
    """The Stanley law: (gain in 1/s, damping) of each command, floor of the speed in m/s, largest angle in rad."""

    left: tuple[float, float] = (0.5, 0.05)
    right: tuple[float, float] = (1.0, 0.075)
    straight: tuple[float, float] = (1.0, 0.1)
    speed_floor: float = 2.0
    max_angle: float = 0.6109  # 35°


@dataclass(frozen=True)
class ControlConfig:
    """The controller. initial_limit: km/h before the first sign. cap: km/h that no limit exceeds, None for no cap.
    blind_brake: brake in [0, 1] where an affordance is not a number."""

    longitudinal: LongitudinalConfig = LongitudinalConfig()
    lateral: LateralConfig = LateralConfig()
    initial_limit: float = 30.0
    cap: float | None = None
    blind_brake: float = 0.5


@dataclass(frozen=True)
class CollectConfig:
    """What to record. weathers: by turns; the clear noon, when shadows are hardest, and the clear sunset, in which most
    is lost at junctions, come twice as often. duration: s of an episode, which is short, as every place and look tells
    most at first; of the time in which the car stands only a part counts. cars: in half of the episodes; the others
    have a third of them, and tailgating ones twice as many. crossing: how much more people cross than usual.

    Shares of the episodes: tailgating ones begin anywhere, and their driver comes close to the cars ahead, at 20 km/h
    at most, for up to six times the duration until he met enough; of the others, before_signs and before_turns begin
    before a sign and before a turn at a junction, and hidden_cars have a driver who is told of no car ahead. displaced
    begin beside their lane; rearranged have other houses, trees and colours along the same streets. semantic: a
    semantic image of each frame.
    """

    town: str = "town01"
    weathers: tuple[int, ...] = (1, 8, 3, 1, 8, 6)
    episodes: int = 1800
    duration: float = 12.0
    cars: int = 75
    people: int = 70
    crossing: float = 5.0
    before_signs: float = 0.35
    before_turns: float = 0.5
    displaced: float = 0.3
    rearranged: float = 0.85
    hidden_cars: float = 0.1
    tailgating: float = 0.2
    width: int = 200
    height: int = 88
    semantic: bool = False
    seed: int = 0
