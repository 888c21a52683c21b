"""What stands around the car, as boxes and lines in space: the town, the route, the others, the lights.

A frame is a place that others are told in: the map, the ego (the middle of the car on the ground), the camera. Axes are
those of ISO 8855, z is up. The towns' heights are left out: all roads lie at z = 0.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from caldrive.datatypes import CameraConfig, LightState, PedestrianState, Points, Pose, TrafficLight, VehicleState
from caldrive.world.roads.network import RoadNetwork, rings
from caldrive.world.roads.route import Route

MAP, EGO, CAMERA = "map", "ego", "camera"
CAR_HEIGHT, PERSON_HEIGHT, GOAL_SIZE = 1.5, 1.7, 1.5  # m
LAMP, LAMP_UP = 0.6, 2.5  # m: how large a light's box is, and how high its middle hangs
LINE_WIDTH = 0.15  # m

Color = tuple[float, float, float, float]  # red, green, blue and opacity in [0, 1]
GREY: Color = (0.55, 0.58, 0.63, 1.0)
DARK: Color = (0.36, 0.39, 0.44, 1.0)
BLUE: Color = (0.35, 0.65, 1.0, 1.0)
AMBER: Color = (1.0, 0.77, 0.33, 0.8)
PINK: Color = (1.0, 0.47, 0.75, 0.8)
WHITE: Color = (0.95, 0.95, 0.95, 0.8)
LIGHTS: dict[LightState, Color] = {
    LightState.RED: (0.95, 0.2, 0.15, 1.0), LightState.YELLOW: (1.0, 0.8, 0.2, 1.0),
    LightState.GREEN: (0.2, 0.85, 0.45, 1.0),
}  # fmt: skip


@dataclass(frozen=True)
class Place:
    """Where a frame is in another one: its origin (x, y, z) in m, and its rotation as a quaternion (x, y, z, w)."""

    frame: str
    parent: str
    origin: tuple[float, float, float]
    rotation: tuple[float, float, float, float]


@dataclass(frozen=True)
class Box:
    """A box by its middle, at a height up (m) above the ground; size: length, width and height, m."""

    pose: Pose
    up: float
    size: tuple[float, float, float]
    color: Color


@dataclass(frozen=True)
class Line:
    """A line through points (N, 2) on the ground; width in m."""

    points: Points
    color: Color
    width: float = LINE_WIDTH


@dataclass(frozen=True)
class Part:
    """What belongs together in a scene, and is shown or hidden together."""

    name: str
    boxes: tuple[Box, ...] = ()
    lines: tuple[Line, ...] = ()


@dataclass(frozen=True)
class Scene:
    """Boxes and lines in a frame. A scene takes the place of the one before it on the same channel."""

    parts: tuple[Part, ...]
    frame: str = MAP


def turned(heading: float) -> tuple[float, float, float, float]:
    """A heading (rad) as a quaternion (x, y, z, w)."""
    return 0.0, 0.0, math.sin(heading / 2), math.cos(heading / 2)


def ego_place(ego: VehicleState) -> Place:
    """Where the ego is on the map."""
    return Place(EGO, MAP, (ego.pose.x, ego.pose.y, 0.0), turned(ego.pose.heading))


def camera_place(camera: CameraConfig) -> Place:
    """Where the camera is on the ego. A camera's own axes are x to the right, y down and z ahead."""
    _, _, s, c = turned(camera.yaw)
    a, b = (c + s) / 2, (c - s) / 2
    return Place(CAMERA, EGO, (camera.forward, camera.left, camera.up), (-a, b, -b, a))


def town_scene(roads: RoadNetwork) -> Scene:
    """The edges of the asphalt, the middles of the lanes and the stop lines."""
    edges = tuple(Line(np.array(ring.coords)[:, :2], GREY) for ring in rings(roads.roadway))
    middles = tuple(Line(lane.line.points, DARK) for lane in roads.lanes.values())
    stops = tuple(Line(np.array(post.stop_line), WHITE, 2 * LINE_WIDTH) for post in roads.posts)
    return Scene((Part("edges", lines=edges), Part("lanes", lines=middles), Part("stop-lines", lines=stops)))


def route_scene(route: Route, goal: Pose) -> Scene:
    """The way to the goal, and the goal."""
    box = Box(goal, GOAL_SIZE / 2, (GOAL_SIZE, GOAL_SIZE, GOAL_SIZE), LIGHTS[LightState.GREEN])
    return Scene((Part("route", lines=(Line(route.way, BLUE, 2 * LINE_WIDTH),)), Part("goal", boxes=(box,))))


def others_scene(cars: Iterable[VehicleState], people: Iterable[PedestrianState]) -> Scene:
    """The other cars, and the people."""
    return Scene((Part("cars", tuple(_car(car, AMBER) for car in cars)), Part("people", tuple(map(_person, people)))))


def ego_scene(ego: VehicleState) -> Scene:
    """The ego's body, in its own frame."""
    return Scene((Part("body", (_car(VehicleState(Pose(0.0, 0.0, 0.0), 0.0, ego.length, ego.width), WHITE),)),), EGO)


def lights_scene(lights: Sequence[TrafficLight]) -> Scene:
    """Each light in its colour, and its stop line in the same."""
    lamps = tuple(Box(light.pose, LAMP_UP, (LAMP, LAMP, LAMP), LIGHTS[light.state]) for light in lights)
    lines = tuple(Line(np.array(light.stop_line), LIGHTS[light.state], 2 * LINE_WIDTH) for light in lights)
    return Scene((Part("lights", lamps, lines),))


def _car(car: VehicleState, color: Color) -> Box:
    return Box(car.pose, CAR_HEIGHT / 2, (car.length, car.width, CAR_HEIGHT), color)


def _person(person: PedestrianState) -> Box:
    return Box(person.pose, PERSON_HEIGHT / 2, (2 * person.radius, 2 * person.radius, PERSON_HEIGHT), PINK)
