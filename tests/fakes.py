"""A world in a few lines: one road, a scripted car ahead, a pedestrian, a light, signs; labelled as any world is."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from caldrive.datatypes import (
    KMH,
    Command,
    Control,
    LightState,
    Observation,
    PedestrianState,
    Points,
    Pose,
    Sign,
    TrafficLight,
    Truth,
    VehicleState,
)
from caldrive.geometry import Polyline, moved
from caldrive.scenarios import Scenario
from caldrive.world.traffic.ego import EgoState, VehicleConfig, advance
from caldrive.world.truth.labels import label

CAR = VehicleConfig()
POST_BEHIND_LINE = 6.6  # m from the stop line to the light's post: the bumper is there when the post leaves A1
IMAGE = np.full((4, 4, 3), (200, 120, 40), np.uint8)


def turn_route(radius: float, side: int, before: float = 40.0, after: float = 60.0) -> Points:
    """Points of a road with one quarter turn, side +1 to the left and -1 to the right."""
    angles = np.arange(0, math.pi / 2, 0.25 / radius)
    arc = np.stack((before + radius * np.sin(angles), side * radius * (1 - np.cos(angles))), axis=1)
    end = (before + radius, side * (radius + after))
    return np.concatenate(([(0.0, 0.0)], arc, [(before + radius, side * radius), end]))


@dataclass
class StraightRoad:
    """A World. Positions of things are arc lengths along the route in m, speeds in km/h, times in s.

    lead: rear bumper of the lead car at a time. person: (x, y) at a time, None while away. light: stop line.
    green_at: when the light turns from red to green. turn_from: the command holds from here on, before it is straight.
    """

    route: Points | None = None
    speed: float = 0.0
    lead: Callable[[float], float] | None = None
    lead_speed: float = 0.0
    person: Callable[[float], tuple[float, float] | None] | None = None
    light: float | None = None
    green_at: float = math.inf
    signs: tuple[tuple[float, int], ...] = ()
    command: Command = Command.STRAIGHT
    turn_from: float = 0.0
    dt: float = 0.1

    def reset(self, scenario: Scenario) -> Observation:
        self.line = Polyline(self.route if self.route is not None else np.array([(0.0, 0.0), (2000.0, 0.0)]))
        self.ego, self.time, self.goal = EgoState(scenario.start, self.speed * KMH), 0.0, scenario.goal
        return self._observation()

    def step(self, control: Control) -> Observation:
        self.ego, self.time = advance(self.ego, control, self.dt, CAR), self.time + self.dt
        return self._observation()

    def close(self) -> None:
        """Nothing to close."""

    @property
    def along(self) -> float:
        """Arc length of the front axle's middle."""
        axle = moved(self.ego.pose, forward=CAR.front_axle)
        return self.line.project(axle.x, axle.y).s

    def _to_goal(self) -> float:
        """Arc length of the goal, if it lies on the route."""
        s = self.line.project(self.goal.x, self.goal.y).s
        there = self.line.pose_at(s)
        return s if math.hypot(there.x - self.goal.x, there.y - self.goal.y) < 1.0 else self.line.length

    def _observation(self) -> Observation:
        command = self.command if self.along >= self.turn_from else Command.STRAIGHT
        return Observation(self.time, IMAGE, self.ego.speed, command)

    def _post(self, s: float) -> Pose:
        return moved(self.line.pose_at(s), left=-3.3)

    def _light(self) -> tuple[TrafficLight, ...]:
        if self.light is None:
            return ()
        line = self.line.pose_at(self.light)
        left, right = moved(line, left=2.0), moved(line, left=-2.0)
        state = LightState.GREEN if self.time >= self.green_at else LightState.RED
        post = self._post(self.light + POST_BEHIND_LINE)
        return (TrafficLight("light", post, state, ((left.x, left.y), (right.x, right.y))),)

    def truth(self) -> Truth:
        person = self.person(self.time) if self.person else None
        people = (PedestrianState(Pose(*person, 0.0), on_road=True, id="person"),) if person else ()
        pose = moved(self.line.pose_at(self.lead(self.time)), forward=2.25) if self.lead else None
        cars = (VehicleState(pose, self.lead_speed * KMH, 4.5, 1.8, "lead"),) if pose else ()
        ego = VehicleState(self.ego.pose, self.ego.speed, CAR.length, CAR.width, "ego")
        signs = [Sign(self._post(s), limit) for s, limit in self.signs]
        return Truth(
            time=self.time,
            ego=ego,
            affordances=label(ego, CAR.front_axle, self.line, None, cars, people, self._light(), signs),
            vehicles=cars,
            pedestrians=people,
            lights=self._light(),
            route_done=self.along,
            route_length=self._to_goal(),
            goal_distance=math.hypot(self.ego.pose.x - self.goal.x, self.ego.pose.y - self.goal.y),
        )
