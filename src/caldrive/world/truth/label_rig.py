"""The labels of one episode: for the ego, and for a car that stands where another camera looks from."""

from __future__ import annotations

import math
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
from caldrive.geometry import moved, positions, wrap_angle
from caldrive.scenarios import Scenario
from caldrive.world.roads.levels import RouteLevel
from caldrive.world.roads.route import Route
from caldrive.world.town import Town
from caldrive.world.truth.labels import label
from caldrive.world.truth.other_commands import Fork, alternatives, forks

IN_REACH = 25.0  # m within which signs and lights count
OFF_ROUTE = math.radians(60.0)  # from which on a car drives another way than its route: its own says what is opposite
MARGIN = 15.0  # m that a car may drive until they are looked for again


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
    """Labels along an episode's route through a town. level: the route's, None where no road runs above another.

    front_axle: m from the ego's centre to its front axle. lights: the town's, in the order of every `WorldState`.
    """

    def __init__(
        self, town: Town, route: Route, scenario: Scenario, front_axle: float, lights: Sequence[TrafficLight]
    ) -> None:
        self.town, self.route, self.scenario, self.front_axle = town, route, scenario, front_axle
        self.level = None if town.roads.is_flat else RouteLevel(town.roads, route)
        self._limits = town.limits_along(route, self.level)
        self._posts = [positions(lights), positions(town.signs)]
        of_posts = {post.id: post.height for post in town.roads.posts}
        self._heights = [[of_posts[light.id] for light in lights], [sign.height for sign in town.signs]]
        self._near: tuple[Pose, list[list[int]]] | None = None  # where it was last looked for posts, and those found

    @cached_property
    def _forks(self) -> list[Fork]:
        return forks(self.town.roads, self.route)

    def label(self, ego: VehicleState, state: WorldState) -> Affordances:
        """The affordances of a car among all others; ego: where that car is and how fast."""
        lights, signs = self._posts_near(ego.pose)
        return label(
            ego,
            self.front_axle,
            self.route.line,
            near=state.progress,
            vehicles=state.vehicles,
            pedestrians=state.pedestrians,
            lights=[state.lights[i] for i in lights],
            signs=[self.town.signs[i] for i in signs],
        )

    def _posts_near(self, here: Pose) -> list[list[int]]:
        """Which lights and signs are in reach, and some more."""
        if self._near is None or math.hypot(here.x - self._near[0].x, here.y - self._near[0].y) > MARGIN:
            square = IN_REACH + MARGIN
            away = [np.abs(posts - (here.x, here.y)).max(axis=1, initial=0.0) for posts in self._posts]
            near = [np.flatnonzero(distances < square).tolist() for distances in away]
            self._near = here, [self._on_level(*kind) for kind in zip(near, self._posts, self._heights, strict=True)]
        return self._near[1]

    def _on_level(self, chosen: list[int], posts: Points, heights: Sequence[float]) -> list[int]:
        """Those of some posts that are not on a bridge over the route, or below it."""
        level = self.level
        return [i for i in chosen if level is None or level.holds(float(posts[i, 0]), float(posts[i, 1]), heights[i])]

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
        if abs(wrap_angle(ego.pose.heading - travel)) > OFF_ROUTE:
            travel = ego.pose.heading
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
            goal_distance=math.hypot(goal.x - ego.pose.x, goal.y - ego.pose.y),
            speed_limit=[limit for s, limit in self._limits if s <= state.progress + 0.1][-1],
        )


def _pose_under(mount: CameraConfig, ego: Pose) -> Pose:
    """Of the car whose camera, in the middle and straight ahead, would take the picture that this one takes."""
    return moved(moved(ego, mount.forward, mount.left, mount.yaw), forward=-mount.forward)
