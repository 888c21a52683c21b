"""The embedded world: a town with traffic, people, lights and a camera, in one process and without a server."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from caldrive.config import CameraConfig, VehicleConfig
from caldrive.datatypes import (
    Affordances,
    Alternative,
    Contact,
    ContactKind,
    Control,
    Image,
    Observation,
    Points,
    Pose,
    Scenario,
    Sign,
    TrafficLight,
    Truth,
    VehicleState,
)
from caldrive.geometry import moved, to_local, wrap_angle
from caldrive.world.alternatives import Fork, alternatives, forks
from caldrive.world.camera import Camera
from caldrive.world.contacts import Obstacle, obstacle_of, resolve
from caldrive.world.labels import label
from caldrive.world.lights import Lights
from caldrive.world.pedestrians import Pedestrians
from caldrive.world.redecoration import redecorated, shown_signs
from caldrive.world.roads import RoadNetwork
from caldrive.world.route import Route, plan_route
from caldrive.world.scenery import build_scenery
from caldrive.world.surface import Surface
from caldrive.world.towns import load_town
from caldrive.world.traffic import Traffic, stop_sumo
from caldrive.world.vehicle import EgoState, advance
from caldrive.world.weather import weather

DT = 0.1  # s, 10 Hz control (section 4)
NEAR = 12.0  # m within which cars and people are tested for contact
SEEN = 40.0  # m within which signs and lights are looked at


class EmbeddedWorld:
    """Implements `World`. camera: None drives without images (a black pixel stands for them), for the oracle."""

    dt = DT

    def __init__(self, camera: CameraConfig | None = None, vehicle: VehicleConfig | None = None) -> None:
        self.mount, self.vehicle = camera, vehicle or VehicleConfig()
        self._town: tuple[str, int] | None = None
        self._camera: Camera | None = None

    def reset(self, scenario: Scenario) -> Observation:
        """Starts an episode. Raises ValueError or FileNotFoundError for a scenario that cannot be."""
        weather(scenario.weather)
        self.enter(scenario.town)
        return self.start(scenario, plan_route(self.roads, scenario.start, scenario.goal))

    def start(self, scenario: Scenario, route: Route) -> Observation:
        """Starts an episode along a given route, in the town entered last."""
        self.scenario, self.route, self.time = scenario, route, 0.0
        lights, people, cars = (np.random.default_rng([scenario.seed, i]) for i in range(3))
        self.ego_state = EgoState(route.line.pose_at(0.0))
        self.progress = 0.0
        self._forks: list[Fork] | None = None
        self.lights = Lights(self.roads, lights)
        self._lights_at = _places(self.lights.shown())
        self.vehicles: tuple[VehicleState, ...] = ()
        self.pedestrians = Pedestrians(self.roads, scenario.n_pedestrians, people, scenario.crossing)
        self.traffic: Traffic | None = None
        if scenario.n_vehicles:
            seed = int(cars.integers(2**31))
            self.traffic = Traffic(self.roads, scenario.n_vehicles, seed, DT, self.ego, self.lights)
        self._limits = self._limits_along(route)
        self._contacts: tuple[Contact, ...] = ()
        return self._observe()

    def step(self, control: Control) -> Observation:
        """Moves everything on by dt."""
        self.ego_state = advance(self.ego_state, control, DT, self.vehicle)
        self.time = round(self.time + DT, 6)
        self.lights.step(self.time, (self.ego, *self.vehicles))
        if self.traffic is not None:
            self.traffic.step(self.time, self.ego, self.people)
        self.pedestrians.step(DT, [self.ego, *self.vehicles])
        self._touch()
        hit = self.route.line.project(self.ego.pose.x, self.ego.pose.y, near=self.progress)
        self.progress = hit.s
        return self._observe()

    def truth(self) -> Truth:
        """What really is, now."""
        return self._truth

    def close(self) -> None:
        """Ends the simulation and frees the camera."""
        stop_sumo()
        if self._camera is not None:
            self._camera.close()
            self._camera = None

    @property
    def ego(self) -> VehicleState:
        return VehicleState(self.ego_state.pose, self.ego_state.speed, self.vehicle.length, self.vehicle.width, "ego")

    def enter(self, town: str, arrangement: int = 0) -> RoadNetwork:
        """Loads a town, if it is not the one already there, without starting an episode.

        arrangement: of its houses, trees, colours and fast limits, 0 for the town as it is.
        """
        if self._town != (town, arrangement):
            self._load(town, arrangement)
        return self.roads

    def displace(self, left: float, turn: float) -> Observation:
        """Puts the ego some metres to the left and turns it (rad)."""
        self.ego_state = replace(self.ego_state, pose=moved(self.ego_state.pose, left=left, turn=turn))
        return self._observe()

    def images(self, mounts: Sequence[CameraConfig]) -> list[Image]:
        """What cameras on the ego see now, (H, W, 3) each."""
        states = {light.id: light.state for light in self.signals}
        return self._eye().render(
            self.scenario.weather, self.ego, self.vehicles, self.people, states, mounts, self.time
        )

    def semantic_images(self, mounts: Sequence[CameraConfig]) -> list[NDArray[np.uint8]]:
        """What each pixel of `images` shows, (H, W) each, as numbers of `semantics.Semantic`."""
        return self._eye().render_semantics(self.ego, self.vehicles, self.people, mounts)

    def _eye(self) -> Camera:
        """The town's camera, made when it is first needed."""
        if self._camera is None:
            self._camera = Camera(self.roads, self.scenery, self._decor)
        return self._camera

    def labels_at(self, mount: CameraConfig) -> Affordances:
        """The affordances of a car that stands where this camera of the ego looks from (the three-camera set-up)."""
        return self._label(replace(self.ego, pose=_under(self.ego.pose, mount)))

    def alternatives_at(self, mount: CameraConfig) -> list[Alternative]:
        """What other commands would ask of such a car, where others could be given."""
        if self._forks is None:
            self._forks = forks(self.roads, self.route)
        there = _under(self.ego.pose, mount)
        return alternatives(moved(there, forward=self.vehicle.front_axle), self._forks, self.progress)

    def _load(self, town: str, arrangement: int) -> None:
        self.roads = load_town(town)
        self.signs = shown_signs(self.roads.signs, arrangement)
        self.scenery = build_scenery(self.roads, arrangement)
        self._decor = redecorated(self.roads.style, arrangement)
        self.surface = Surface(self.roads)
        solid = [prop for prop in self.scenery if prop.solid]
        self._solid = [
            Obstacle(ContactKind.OBJECT, f"{p.kind}{i}", p.pose, p.length, p.width) for i, p in enumerate(solid)
        ]
        self._solid_at = _places(self._solid)
        self._signs_at = _places(self.signs)
        self._solid_reach = np.array([np.hypot(o.length, o.width) / 2 for o in self._solid])
        if self._camera is not None:
            self._camera.close()
            self._camera = None
        self._town = town, arrangement

    def _touch(self) -> None:
        """Finds contacts and lets them act on the ego."""
        x, y = self.ego.pose.x, self.ego.pose.y
        distance = np.hypot(self._solid_at[:, 0] - x, self._solid_at[:, 1] - y) - self._solid_reach
        near = [self._solid[i] for i in np.flatnonzero(distance < 4.0)]
        near += [obstacle_of(car) for car in self.vehicles if abs(car.pose.x - x) + abs(car.pose.y - y) < NEAR]
        near += [obstacle_of(one) for one in self.people if abs(one.pose.x - x) + abs(one.pose.y - y) < NEAR]
        ego, self._contacts = resolve(self.ego, near)
        self.ego_state = replace(self.ego_state, pose=ego.pose, speed=ego.speed)

    def _limits_along(self, route: Route) -> list[tuple[float, float]]:
        """Where which limit begins along the route (m, km/h)."""
        found = [(0.0, self.roads.lanes[route.lanes[0][0]].limit)]
        for sign in self.signs:
            hit = route.line.project(sign.pose.x, sign.pose.y)
            if -7 < hit.left < -1 and abs(wrap_angle(hit.heading - sign.pose.heading)) < 0.5:
                found.append((hit.s, float(sign.limit)))
        return sorted(found)

    def _label(self, ego: VehicleState) -> Affordances:
        signs = [self.signs[i] for i in _near(ego.pose, self._signs_at, SEEN)]
        lights = [self.signals[i] for i in _near(ego.pose, self._lights_at, SEEN)]
        return label(
            ego, self.vehicle.front_axle, self.route.line, self.progress, self.vehicles, self.people, lights, signs
        )

    def _observe(self) -> Observation:
        self.vehicles = self.traffic.cars if self.traffic is not None else ()
        self.people = self.pedestrians.states()
        self.signals: tuple[TrafficLight, ...] = self.lights.shown()
        self._truth = self._find_truth()
        image = self.images([self.mount])[0] if self.mount is not None else np.zeros((1, 1, 3), np.uint8)
        self.observation = Observation(self.time, image, self.ego.speed, self.route.command_at(self.progress))
        return self.observation

    def _find_truth(self) -> Truth:
        ego, goal = self.ego, self.scenario.goal
        travel = self.route.line.heading_at(self.progress)
        opposite, sidewalk = self.surface.shares(ego, travel)
        return Truth(
            time=self.time,
            ego=ego,
            affordances=self._label(ego),
            vehicles=self.vehicles,
            pedestrians=self.people,
            lights=self.signals,
            contacts=self._contacts,
            opposite_share=opposite,
            sidewalk_share=sidewalk,
            route_done=min(self.progress, self.route.length),
            route_length=self.route.length,
            goal_distance=float(np.linalg.norm(to_local(ego.pose, np.array([goal.x, goal.y])))),
            speed_limit=[limit for s, limit in self._limits if s <= self.progress + 0.1][-1],
        )


def _places(things: Sequence[Obstacle] | Sequence[Sign] | Sequence[TrafficLight]) -> Points:
    return np.array([(thing.pose.x, thing.pose.y) for thing in things]).reshape(-1, 2)


def _near(here: Pose, places: Points, reach: float) -> list[int]:
    """Which places lie within a square around here."""
    return np.flatnonzero(np.abs(places - (here.x, here.y)).max(axis=1, initial=0.0) < reach).tolist()


def _under(ego: Pose, mount: CameraConfig) -> Pose:
    """Of the car whose camera, in the middle and straight ahead, would take the picture that this one takes."""
    return moved(moved(ego, mount.forward, mount.left, mount.yaw), forward=-mount.forward)
