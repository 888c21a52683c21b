"""The labels of one episode: for the ego, and for a car that stands where another camera looks from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from caldrive.datatypes import (
    Affordances,
    Alternative,
    CameraConfig,
    Contact,
    PedestrianState,
    Points,
    Pose,
    TrafficLight,
    Truth,
    VehicleState,
)
from caldrive.geometry import moved, positions, to_local
from caldrive.scenarios import Scenario
from caldrive.world.roads.route import Route
from caldrive.world.town import Town
from caldrive.world.truth.labels import label
from caldrive.world.truth.other_commands import Fork, alternatives, forks

IN_REACH = 40.0  # m within which signs and lights are looked at


@dataclass(frozen=True)
class WorldState:
    """Who and what is where at one time."""

    time: float
    """s since the start of the episode."""
    ego: VehicleState
    vehicles: tuple[VehicleState, ...]
    pedestrians: tuple[PedestrianState, ...]
    lights: tuple[TrafficLight, ...]
    contacts: tuple[Contact, ...]
    """Of the ego, in the last step."""
    progress: float
    """m of the route that the ego has driven."""


class LabelRig:
    """Labels along an episode's route through a town.

    front_axle: m from the ego's centre to its front axle. lights: the town's, in the order of every `WorldState`.
    """

    def __init__(
        self, town: Town, route: Route, scenario: Scenario, front_axle: float, lights: Sequence[TrafficLight]
    ) -> None:
        self.town, self.route, self.scenario, self.front_axle = town, route, scenario, front_axle
        self._limits = town.limits_along(route)
        self._signs_at, self._lights_at = positions(town.signs), positions(lights)

    @cached_property
    def _forks(self) -> list[Fork]:
        return forks(self.town.roads, self.route)

    def label(self, ego: VehicleState, state: WorldState) -> Affordances:
        """The affordances of a car among all others; ego: where that car is and how fast."""
        return label(
            ego,
            self.front_axle,
            self.route.line,
            near=state.progress,
            vehicles=state.vehicles,
            pedestrians=state.pedestrians,
            lights=[state.lights[i] for i in _near(ego.pose, self._lights_at)],
            signs=[self.town.signs[i] for i in _near(ego.pose, self._signs_at)],
        )

    def label_at(self, mount: CameraConfig, state: WorldState) -> Affordances:
        """The affordances of a car that stands where this camera of the ego looks from (the three-camera set-up)."""
        return self.label(replace(state.ego, pose=_pose_under(mount, state.ego.pose)), state)

    def other_commands_at(self, mount: CameraConfig, state: WorldState) -> list[Alternative]:
        """What other commands would ask of such a car, where others could be given."""
        axle = moved(_pose_under(mount, state.ego.pose), forward=self.front_axle)
        return alternatives(axle, self._forks, state.progress)

    def truth(self, state: WorldState) -> Truth:
        """All that is true of a state of the world."""
        ego, goal = state.ego, self.scenario.goal
        travel = self.route.line.heading_at(state.progress)
        opposite, sidewalk = self.town.ground.shares(ego, travel)
        return Truth(
            time=state.time,
            ego=ego,
            affordances=self.label(ego, state),
            vehicles=state.vehicles,
            pedestrians=state.pedestrians,
            lights=state.lights,
            contacts=state.contacts,
            opposite_share=opposite,
            sidewalk_share=sidewalk,
            route_done=min(state.progress, self.route.length),
            route_length=self.route.length,
            goal_distance=float(np.linalg.norm(to_local(ego.pose, np.array([goal.x, goal.y])))),
            speed_limit=[limit for s, limit in self._limits if s <= state.progress + 0.1][-1],
        )


def _near(here: Pose, positions: Points) -> list[int]:
    """Which of the positions (N, 2) lie within a square around here."""
    return np.flatnonzero(np.abs(positions - (here.x, here.y)).max(axis=1, initial=0.0) < IN_REACH).tolist()


def _pose_under(mount: CameraConfig, ego: Pose) -> Pose:
    """Of the car whose camera, in the middle and straight ahead, would take the picture that this one takes."""
    return moved(moved(ego, mount.forward, mount.left, mount.yaw), forward=-mount.forward)
