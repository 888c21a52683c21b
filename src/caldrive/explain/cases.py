"""Moments of a drive in which one thing alone decides what an affordance is: a lamp, a person, a car, a sign.

The oracle drives, without a camera. What its pictures would have shown is kept, so that they can be drawn as they were,
and again with that one thing changed.
"""

from __future__ import annotations

import math
from collections import Counter, deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from caldrive.datatypes import CameraConfig, LightState, PedestrianState, Pose, TrafficLight, Truth, VehicleState
from caldrive.driving.referee import Referee
from caldrive.driving.rollout import rollout
from caldrive.explain.activation_maps import Question
from caldrive.explain.situations import NEAR_CAR
from caldrive.geometry import moved, to_local
from caldrive.interfaces import Agent
from caldrive.scenarios import Scenario
from caldrive.world.embedded import EmbeddedWorld
from caldrive.world.rendering.camera import SceneState
from caldrive.world.scene.people import HEIGHT
from caldrive.world.scene.weather import lighting, weather
from caldrive.world.town import Town
from caldrive.world.truth.labels import A1, A2, A3, faces, light_area

CAMERA = CameraConfig()
NEAREST, FARTHEST = 4.0, 60.0  # m ahead at which a thing is looked for that is of no concern
APART = 8.0  # m between two lights of which one is of no concern: nearer, they may share a post
BODY = 0.6  # m beside the picture's edge from which on nothing of a person's body is in it
SHADOW_REACH = 12.0  # m
ALONG = (0.25, 0.5, 0.75, 1.0)  # places of a shadow, as shares of its length
Thing = TrafficLight | PedestrianState | VehicleState


@dataclass(frozen=True)
class Moment:
    """What is true at one step of a drive."""

    truth: Truth
    axle: Pose
    """The middle of the ego's front axle."""
    town: Town
    weather: int

    def seen_at(self, pose: Pose) -> tuple[float, float]:
        """How far ahead of the camera a place is, and how far to the left, m."""
        eye = moved(self.truth.ego.pose, forward=CAMERA.forward)
        x, y = to_local(eye, np.array([(pose.x, pose.y)]))[0].tolist()
        return x, y

    def in_the_way(self) -> tuple[list[PedestrianState], list[VehicleState]]:
        """People and cars whose centres are where a hazard is."""
        people, cars = A2.among(self.axle, self.truth.pedestrians), A2.among(self.axle, self.truth.vehicles)
        return [person for _, person in people], [car for _, car in cars]

    def nearest_other(self, things: Sequence[Thing], concern: Sequence[Thing]) -> str | None:
        """The id of the nearest in view of some things that are of no concern."""
        free = [(self.seen_at(thing.pose), thing) for thing in things if thing not in concern]
        seen = [(at[0], thing.id) for at, thing in free if _in_view(*at)]
        return min(seen)[1] if seen else None


Subject = tuple[str, str | None]  # the id of what decides, and of a thing of its kind that is of no concern


@dataclass(frozen=True)
class Situation:
    """A kind of moment."""

    name: str
    affordance: str
    """What is decided."""
    holds: bool | None
    """What is true of that: a network that sees it says so. None where that is the question."""
    subject: Callable[[Moment], Subject | None]
    """What decides it, None at other moments."""


@dataclass(frozen=True)
class Case:
    """A moment of a drive, with what its pictures show."""

    situation: Situation
    subject: str
    """The id of what decides; of a sign its number among the town's."""
    other: str | None
    """The id of a thing of the same kind that is of no concern."""
    question: Question
    states: tuple[SceneState, ...]
    """Of the frames that the network looks at, the oldest first."""


def _in_view(ahead: float, left: float) -> bool:
    return NEAREST < ahead < FARTHEST and abs(left) < ahead * math.tan(math.radians(CAMERA.fov / 2))


def _light(is_red: bool) -> Callable[[Moment], Subject | None]:
    def subject(moment: Moment) -> Subject | None:
        truth, axle = moment.truth, moment.axle
        inside = [light for _, light in light_area(truth.ego.speed).among(axle, truth.lights)]
        of_concern = [light for light in inside if faces(light.pose, axle)]
        if not of_concern or bool(truth.affordances.red_light) != is_red:
            return None
        if is_red:
            of_concern = [light for light in of_concern if light.state is not LightState.GREEN]
        one = of_concern[0]
        others = [light for light in truth.lights if _is_seen(light, axle) and _distance(light, one) > APART]
        return one.id, moment.nearest_other(others, of_concern)

    return subject


def _is_seen(light: TrafficLight, axle: Pose) -> bool:
    """Whether a light shows its lamps to an axle."""
    dx, dy = light.pose.x - axle.x, light.pose.y - axle.y
    return math.cos(light.pose.heading) * dx + math.sin(light.pose.heading) * dy > 0


def _distance(one: TrafficLight, other: TrafficLight) -> float:
    return math.hypot(one.pose.x - other.pose.x, one.pose.y - other.pose.y)


def _person(moment: Moment) -> Subject | None:
    people, cars = moment.in_the_way()
    if len(people) != 1 or cars:
        return None
    return people[0].id, moment.nearest_other(moment.truth.pedestrians, people)


def _car_in_the_way(moment: Moment) -> Subject | None:
    truth, (people, cars) = moment.truth, moment.in_the_way()
    if people or len(cars) != 1 or not truth.affordances.hazard_stop:
        return None
    of_concern = [*cars, *(car for _, car in A3.among(moment.axle, truth.vehicles))]  # the areas differ in width
    return cars[0].id, moment.nearest_other(truth.vehicles, of_concern)


def _car_ahead(moment: Moment) -> Subject | None:
    truth = moment.truth
    cars = [car for _, car in A3.among(moment.axle, truth.vehicles)]
    if len(cars) != 1 or truth.affordances.vehicle_distance >= NEAR_CAR:
        return None
    return cars[0].id, moment.nearest_other(truth.vehicles, cars)


def _sign(moment: Moment) -> Subject | None:
    signs = [(ahead, sign) for ahead, sign in A1.among(moment.axle, moment.town.signs) if faces(sign.pose, moment.axle)]
    if moment.truth.affordances.speed_sign is None:
        return None
    _, sign = min(signs, key=lambda one: one[0])
    return str(moment.town.signs.index(sign)), None


def _shadow(moment: Moment) -> Subject | None:
    """A person beside the picture whose shadow falls into it, where nothing else is in the way."""
    if moment.truth.affordances.hazard_stop:
        return None
    x, y, z = lighting(weather(moment.weather), moment.town.appearance.sun_azimuth).sun_direction.tolist()
    thrown = -x / z * HEIGHT, -y / z * HEIGHT
    found = [one for one in moment.truth.pedestrians if _only_shadow_is_seen(moment, one, thrown)]
    return (found[0].id, None) if found else None


def _only_shadow_is_seen(moment: Moment, person: PedestrianState, thrown: tuple[float, float]) -> bool:
    """thrown: m from a person's foot to the end of the shadow, along x and y."""
    ahead, left = moment.seen_at(person.pose)
    slope = math.tan(math.radians(CAMERA.fov / 2))
    if math.hypot(ahead, left) > SHADOW_REACH or abs(left) < ahead * slope + BODY * math.hypot(1, slope):
        return False
    along = [(person.pose.x + share * thrown[0], person.pose.y + share * thrown[1]) for share in ALONG]
    places = [moment.seen_at(Pose(*place, 0.0)) for place in along]
    return any(ahead > 1.0 and abs(left) < ahead * slope for ahead, left in places)


SITUATIONS = (
    Situation("red light", "red_light", True, _light(is_red=True)),
    Situation("green light", "red_light", False, _light(is_red=False)),
    Situation("hazard by a person", "hazard_stop", True, _person),
    Situation("hazard by a car", "hazard_stop", True, _car_in_the_way),
    Situation("car ahead", "vehicle_distance", True, _car_ahead),
    Situation("speed sign", "speed_sign", True, _sign),
    Situation("shadow of a person out of view", "hazard_stop", None, _shadow),
)


def find_cases(
    world: EmbeddedWorld, agent: Agent, scenario: Scenario, *, span: int, rng: np.random.Generator
) -> list[Case]:
    """Drives an episode; returns a random moment of each situation for each thing that decides it. span: frames that a
    network looks at."""
    counts = Counter[tuple[str, str]]()
    chosen: dict[tuple[str, str], Case] = {}
    for case in _moments(world, agent, scenario, span):
        key = case.situation.name, case.subject
        counts[key] += 1
        if rng.random() < 1 / counts[key]:  # each moment is as likely to stay
            chosen[key] = case
    return list(chosen.values())


def _moments(world: EmbeddedWorld, agent: Agent, scenario: Scenario, span: int) -> Iterator[Case]:
    """Every moment of every situation in an episode, from the first one on that has a whole history."""
    history, referee = deque[SceneState](maxlen=span), Referee(scenario)
    for step in rollout(world, agent, scenario):
        history.append(world.scene())
        truth = step.truth
        moment = Moment(truth, moved(truth.ego.pose, world.vehicle.front_axle), world.town, scenario.weather)
        for situation in SITUATIONS if len(history) == span else ():
            if found := situation.subject(moment):
                label = truth.affordances.speed_sign if situation.affordance == "speed_sign" else None
                question = Question(situation.affordance, step.observation.command, label)
                yield Case(situation, *found, question, tuple(history))
        if referee.watch(truth) is not None:
            return
