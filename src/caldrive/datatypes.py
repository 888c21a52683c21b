"""The vocabulary that every part of caldrive shares, as frozen dataclasses.

Units are SI, axes are ISO 8855: x forward (or east), y left (or north), headings counter-clockwise in radians.
Speeds on signs are the one exception: they are the km/h that stand on the sign.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum, IntEnum

import numpy as np
from numpy.typing import NDArray

KMH = 1 / 3.6  # m/s in a km/h
DT = 0.1  # s between two controls, 10 Hz (section 4)
Image = NDArray[np.uint8]  # (H, W, 3), RGB
Points = NDArray[np.float64]  # (N, 2), metres
SPEED_SIGNS = (30, 60, 90)  # km/h
MAX_VEHICLE_DISTANCE = 50.0  # m, also the value for "no vehicle ahead" (Fig. 3 of the paper)
MAX_CENTER_DISTANCE = 2.0  # m
HAZARD_DISTANCE = 6.0  # m; a car on its way that is a hazard is nearer, only one that stands across may not be


class Command(Enum):
    """What the navigation system asks for at the next junction (section 3)."""

    LEFT = "left"
    STRAIGHT = "straight"
    RIGHT = "right"


class LightState(Enum):
    """What a traffic light shows."""

    GREEN = "green"
    YELLOW = "yellow"
    RED = "red"


class ContactKind(Enum):
    """What the ego can touch."""

    OBJECT = "object"
    CAR = "car"
    PERSON = "person"


@dataclass(frozen=True)
class Pose:
    """Position of a body's centre (m) and its heading (rad, counter-clockwise from the x axis)."""

    x: float
    y: float
    heading: float


@dataclass(frozen=True)
class VehicleState:
    """An oriented box on the road: centre pose, speed along the heading (m/s), length and width (m)."""

    pose: Pose
    speed: float = 0.0
    length: float = 4.5
    width: float = 1.8
    id: str = ""


@dataclass(frozen=True)
class PedestrianState:
    """A person: centre pose, walking speed (m/s), radius (m) and whether they are on the roadway."""

    pose: Pose
    speed: float = 0.0
    radius: float = 0.3
    on_road: bool = False
    id: str = ""


@dataclass(frozen=True)
class Sign:
    """A speed sign: the place right beside its lane, with the heading of the traffic that it is for, and the limit in
    km/h. foot: where its post stands, if it is not there. height: of the road, m."""

    pose: Pose
    limit: int
    foot: Pose | None = None
    height: float = 0.0

    @property
    def stands_at(self) -> Pose:
        """Where the post is to be seen."""
        return self.foot or self.pose


@dataclass(frozen=True)
class TrafficLight:
    """A light on its post: foot of the post, heading of the traffic it faces, state, and the ends of its stop line."""

    id: str
    pose: Pose
    state: LightState
    stop_line: tuple[tuple[float, float], tuple[float, float]]


@dataclass(frozen=True)
class Control:
    """What the driver does. throttle and brake in [0, 1], steer in [-1, 1] with + to the left."""

    throttle: float = 0.0
    brake: float = 0.0
    steer: float = 0.0

    def __post_init__(self) -> None:
        for name, low in (("throttle", 0.0), ("brake", 0.0), ("steer", -1.0)):
            value = getattr(self, name)
            if not low <= value <= 1.0:
                raise ValueError(f"{name} is {value}, but must lie in [{low:g}, 1]: clip it before making a Control")


@dataclass(frozen=True)
class Affordances:
    """The six affordances (section 3, Fig. 3): one type for labels and for predictions.

    hazard_stop, red_light: probabilities; a label is 0.0 or 1.0.
    speed_sign: None, 30, 60 or 90 km/h.
    vehicle_distance: bumper to bumper in m, 50 where nobody is ahead.
    relative_angle: heading of the route minus heading of the car, rad; + means the road bends away to the left.
    center_distance: from the middle of the front axle to the centre line, m; + means that the line lies to the left.
    """

    hazard_stop: float = 0.0
    red_light: float = 0.0
    speed_sign: int | None = None
    vehicle_distance: float = MAX_VEHICLE_DISTANCE
    relative_angle: float = 0.0
    center_distance: float = 0.0


@dataclass(frozen=True)
class Alternative:
    """Another command that could be given, and the affordances that depend on it, as in `Affordances`."""

    command: Command
    relative_angle: float
    center_distance: float


@dataclass(frozen=True)
class CameraConfig:
    """A pinhole camera on the car. The default is the authors' 800 x 600 camera with rows 120 to 480 kept, drawn
    straight at the network's size."""

    width: int = 200
    """Pixels."""
    height: int = 88
    """Pixels."""
    fov: float = 90.0
    """Horizontal field of view, degrees."""
    forward: float = 1.44
    """m ahead of the car's centre."""
    left: float = 0.0
    """m to its left."""
    up: float = 1.2
    """m above the ground."""
    yaw: float = 0.0
    """rad to the left."""


@dataclass(frozen=True)
class Observation:
    """All that an agent may see: time (s), image (H, W, 3), speed (m/s) and the command. image_time: when the image was
    taken (s), None for now. auxiliary: the image of a second camera, for an agent that asks for one."""

    time: float
    image: Image
    speed: float
    command: Command
    image_time: float | None = None
    auxiliary: Image | None = None


@dataclass(frozen=True)
class Contact:
    """The ego touches something: what, which one, impulse (N s), and whether the ego's moving front or side did it."""

    kind: ContactKind
    id: str
    impulse: float
    at_fault: bool


@dataclass(frozen=True)
class Truth:
    """What really is, for referee, recorder and oracle.

    opposite_share, sidewalk_share: shares in [0, 1] of the car's area on the opposite lane, and off the road.
    route_done, route_length: metres along the route. goal_distance: straight line to the goal, m.
    """

    time: float
    ego: VehicleState
    affordances: Affordances
    vehicles: tuple[VehicleState, ...] = ()
    pedestrians: tuple[PedestrianState, ...] = ()
    lights: tuple[TrafficLight, ...] = ()
    contacts: tuple[Contact, ...] = ()
    opposite_share: float = 0.0
    sidewalk_share: float = 0.0
    route_done: float = 0.0
    route_length: float = math.inf
    goal_distance: float = math.inf
    speed_limit: float = 30.0  # km/h, the lawful one at this place


@dataclass(frozen=True)
class Decision:
    """Why a control was chosen, as far as the agent says: what it saw, its state, limit and target in km/h, a note."""

    control: Control
    affordances: Affordances | None = None
    state: str | None = None
    speed_limit: float | None = None
    target_speed: float | None = None
    note: str = ""


@dataclass(frozen=True)
class Step:
    """One turn of the loop: what was seen, what was true, what was done, and the reasons if the agent gives any."""

    observation: Observation
    truth: Truth
    control: Control
    decision: Decision | None = None


class Semantic(IntEnum):
    """Classes of pixels, as numbers in a recording."""

    SKY = 0
    ROAD = 1
    LINE = 2
    SIDEWALK = 3
    GROUND = 4
    BUILDING = 5
    PLANT = 6
    FURNITURE = 7
    LIGHT = 8
    SIGN = 9
    VEHICLE = 10
    PERSON = 11
