"""A world of one road with a few things on it, labelled as any world is: many times as fast as real time."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from caldrive.datatypes import (
    DT,
    KMH,
    Command,
    Contact,
    ContactKind,
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
from caldrive.world.truth.labels import A1, label

CAR = VehicleConfig()
LANE = 3.5  # m, its width; the road has one for each direction
CRASH = 1000.0  # N s, more than any benchmark asks of a collision
IMAGE = np.full((4, 4, 3), (200, 120, 40), np.uint8)


def turn_route(radius: float, side: int, before: float = 40.0, after: float = 60.0) -> Points:
    """Points (N, 2) of a road with one quarter turn, side +1 to the left and -1 to the right; lengths in m."""
    angles = np.arange(0, math.pi / 2, 0.25 / radius)
    arc = np.stack((before + radius * np.sin(angles), side * radius * (1 - np.cos(angles))), axis=1)
    end = (before + radius, side * (radius + after))
    return np.concatenate(([(0.0, 0.0)], arc, [(before + radius, side * radius), end]))


@dataclass
class SingleRoad:
    """A `World`. Positions of things are arc lengths along the route in m, speeds in km/h, times in s."""

    route: Points | None = None
    """Points of the road's middle line (N, 2); None for 2 km straight on."""
    speed: float = 0.0
    """Of the ego at the start."""
    lead: Callable[[float], float] | None = None
    """The rear bumper of the car ahead at a time."""
    lead_speed: float = 0.0
    """That car's speed."""
    person: Callable[[float], tuple[float, float] | None] | None = None
    """Where a person stands (x, y) at a time, None while away."""
    light: float | None = None
    """The stop line of a light, beside which it stands, as in a town."""
    green_at: float = math.inf
    """When the light turns from red to green."""
    signs: tuple[tuple[float, int], ...] = ()
    """Places and limits of speed signs, by place; they count from where they can be read."""
    command: Command = Command.STRAIGHT
    """What is asked for between the next two places; elsewhere it is straight."""
    turn_from: float = 0.0
    turn_until: float = math.inf
    dt: float = DT

    def reset(self, scenario: Scenario) -> Observation:
        """Puts the ego at the scenario's start, whose town does not matter."""
        self.line = Polyline(self.route if self.route is not None else np.array([(0.0, 0.0), (2000.0, 0.0)]))
        self.ego, self.time, self.goal = EgoState(scenario.start, self.speed * KMH), 0.0, scenario.goal
        return self._observation()

    def step(self, control: Control) -> Observation:
        """Moves the ego on by dt."""
        self.ego, self.time = advance(self.ego, control, self.dt, CAR), self.time + self.dt
        return self._observation()

    def close(self) -> None:
        """Nothing to close."""

    @property
    def along(self) -> float:
        """Arc length of the front axle's middle, m."""
        axle = moved(self.ego.pose, forward=CAR.front_axle)
        return self.line.project(axle.x, axle.y).s

    def truth(self) -> Truth:
        """What really is, now."""
        person = self.person(self.time) if self.person else None
        people = (PedestrianState(Pose(*person, 0.0), on_road=True, id="person"),) if person else ()
        pose = moved(self.line.pose_at(self.lead(self.time)), forward=2.25) if self.lead else None
        cars = (VehicleState(pose, self.lead_speed * KMH, 4.5, 1.8, "lead"),) if pose else ()
        ego = VehicleState(self.ego.pose, self.ego.speed, CAR.length, CAR.width, "ego")
        signs = [Sign(self._post(s), limit) for s, limit in self.signs]
        affordances = label(ego, CAR.front_axle, self.line, None, cars, people, self._light(), signs)
        touched = affordances.vehicle_distance == 0
        left, right = self._outside()
        return Truth(
            time=self.time,
            ego=ego,
            affordances=affordances,
            vehicles=cars,
            pedestrians=people,
            lights=self._light(),
            contacts=(Contact(ContactKind.CAR, "lead", CRASH, at_fault=True),) if touched else (),
            opposite_share=left,
            sidewalk_share=right,
            route_done=self.along,
            route_length=self._to_goal(),
            goal_distance=math.hypot(self.ego.pose.x - self.goal.x, self.ego.pose.y - self.goal.y),
            speed_limit=next((float(limit) for s, limit in reversed(self.signs) if s <= self.along + A1.far), 30.0),
        )

    def _to_goal(self) -> float:
        """Arc length of the goal, if it lies on the route."""
        s = self.line.project(self.goal.x, self.goal.y).s
        there = self.line.pose_at(s)
        return s if math.hypot(there.x - self.goal.x, there.y - self.goal.y) < 1.0 else self.line.length

    def _observation(self) -> Observation:
        turns = self.turn_from <= self.along < self.turn_until
        return Observation(self.time, IMAGE, self.ego.speed, self.command if turns else Command.STRAIGHT)

    def _post(self, s: float) -> Pose:
        return moved(self.line.pose_at(s), left=-3.3)

    def _light(self) -> tuple[TrafficLight, ...]:
        if self.light is None:
            return ()
        line = self.line.pose_at(self.light)
        left, right = moved(line, left=LANE / 2), moved(line, left=-LANE / 2)
        state = LightState.GREEN if self.time >= self.green_at else LightState.RED
        post = self._post(self.light)
        return (TrafficLight("light", post, state, ((left.x, left.y), (right.x, right.y))),)

    def _outside(self) -> tuple[float, float]:
        """The shares of the car's width to the left and to the right of its lane."""
        left = self.line.project(self.ego.pose.x, self.ego.pose.y).left
        beyond = [(side * left + CAR.width / 2 - LANE / 2) / CAR.width for side in (1, -1)]
        return min(max(beyond[0], 0.0), 1.0), min(max(beyond[1], 0.0), 1.0)
