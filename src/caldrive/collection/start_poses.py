"""Where recorded episodes begin: anywhere, or shortly before what is rare, such as speed signs and turns."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from caldrive.agents.cal import CALAgent, OraclePerception
from caldrive.collection.config import CollectConfig
from caldrive.collection.oracles import random_oracle
from caldrive.control.controller import CALController, ControlConfig
from caldrive.control.patience import PatienceConfig
from caldrive.datatypes import Command, Observation, Pose, Sign
from caldrive.interfaces import RecordableWorld
from caldrive.scenarios import Scenario
from caldrive.world.roads.network import Lane, RoadNetwork
from caldrive.world.roads.route import Route, random_route
from caldrive.world.scene.domain_randomisation import one_of
from caldrive.world.town import load_town
from caldrive.world.traffic.start_places import room

BEFORE_SIGN, BEFORE_TURN = (15.0, 45.0), (2.0, 25.0)  # m
LANE_MARGIN = 3.0  # m kept to the ends of a lane by a start anywhere; shorter lanes than four times this have none
OFFSETS, MAX_TURN = (-1.5, 4.0), 0.4  # m to the left, from the kerb to the opposite lane, and rad
CAPS = (20.0, 20.0, None)  # km/h, one of them at random, None for the signs alone; tailgating drivers have the first
MEAN_SPEED, TAILGATING_SPEED = 14, 6  # m/s; no episode is faster in the mean, and no tailgating one
SEARCH = 6  # times the wanted duration that a tailgating driver may drive, who has to find a car


def start_pose(
    roads: RoadNetwork, signs: Sequence[Sign], before_signs: float, before_turns: float, rng: np.random.Generator
) -> tuple[Pose, str | None]:
    """Anywhere on the roads, or in a share of the cases some way before a sign or a turn at a junction; each limit and
    each command gets as many of these. Returns the pose, and the id of that turn's lane if any."""
    chance = rng.random()
    limits = sorted({sign.limit for sign in signs})
    if limits and chance < before_signs:
        limit = one_of(limits, rng)
        sign = one_of([sign for sign in signs if sign.limit == limit], rng)
        lane, s = roads.lane_at(sign.pose)
        return _upstream(roads, lane, s - float(rng.uniform(*BEFORE_SIGN))), None
    turns = [lane for lane in roads.lanes.values() if lane.turn is not None]
    commands = [command for command in Command if any(lane.turn is command for lane in turns)]
    if commands and before_signs <= chance < before_signs + before_turns:
        command = one_of(commands, rng)
        turn = one_of([lane for lane in turns if lane.turn is command], rng)
        return _upstream(roads, turn, -float(rng.uniform(*BEFORE_TURN))), turn.id
    lane = one_of([lane for lane in roads.driveable if lane.line.length > 4 * LANE_MARGIN], rng)
    return lane.line.pose_at(float(rng.uniform(LANE_MARGIN, lane.line.length - LANE_MARGIN))), None


def _upstream(roads: RoadNetwork, lane: Lane, s: float) -> Pose:
    """The place s m along a lane; where that is negative, as far up the street before it, but inside no junction."""
    before = [other for other in roads.lanes.values() if lane.id in other.successors]
    if s >= 1 or len(before) != 1 or before[0].turn is not None:
        return lane.line.pose_at(max(s, 1.0))
    return _upstream(roads, before[0], s + before[0].line.length)


@dataclass(frozen=True)
class EpisodePlan:
    """What an episode is before it begins."""

    scenario: Scenario
    """Where it drives, and among whom."""
    route: Route
    """The way, with random turns."""
    appearance: int
    """The number of the town's appearance, 0 for its own."""
    tailgating: bool
    """Whether the driver looks for cars and comes close to them."""


def plan_episode(config: CollectConfig, number: int, rng: np.random.Generator) -> EpisodePlan:
    """A random start and random turns. number: of the episode, from 0."""
    tailgating = rng.random() < config.tailgating
    appearance = int(rng.integers(1, 2**31))
    town = load_town(config.town, appearance if rng.random() < config.randomised else 0)
    shares = (0.0, 0.0) if tailgating else (config.before_signs, config.before_turns)
    start, turn = start_pose(town.roads, town.signs, *shares, rng)
    length = config.duration * (SEARCH * TAILGATING_SPEED if tailgating else MEAN_SPEED) + 50
    route = random_route(town.roads, start, length, rng, turn)
    scenario = Scenario(
        town=config.town, weather=config.weathers[number % len(config.weathers)], start=start,
        goal=route.line.pose_at(route.length), n_vehicles=_cars(config, tailgating, room(town.roads), rng),
        n_pedestrians=config.people, time_limit=config.duration, seed=int(rng.integers(2**31)), task="collect",
        crossing=config.crossing,
    )  # fmt: skip
    return EpisodePlan(scenario=scenario, route=route, appearance=town.appearance.number, tailgating=tailgating)


def _cars(config: CollectConfig, tailgating: bool, most: int, rng: np.random.Generator) -> int:
    """How many others drive; most: for how many there is room."""
    if tailgating:
        return min(2 * config.cars, most)
    return config.cars if rng.random() < 0.5 else config.cars // 3


def begin_episode(
    world: RecordableWorld, config: CollectConfig, plan: EpisodePlan, rng: np.random.Generator
) -> tuple[Observation, CALAgent, CALAgent]:
    """The first observation, the driver, and one in his place who is told the truth, both ready. They are the same but
    where the driver is deceived: what a recording tells others to do is what the other one would."""
    cap = CAPS[0] if plan.tailgating else CAPS[int(rng.integers(len(CAPS)))]
    oracle = random_oracle(world.truth, config, plan.tailgating, rng)
    # A driver to whom no car is reported must not take the car before it for no hazard after a while.
    laws = ControlConfig(patience=PatienceConfig(enabled=False), cap=cap)
    agent = honest = CALAgent(oracle, CALController(laws))
    if type(oracle) is not OraclePerception:
        honest = CALAgent(OraclePerception(world.truth), CALController(laws))
    observation = world.reset(plan.scenario, route=plan.route, appearance=plan.appearance)
    if rng.random() < config.displaced:
        observation = world.displace(float(rng.uniform(*OFFSETS)), float(rng.uniform(-MAX_TURN, MAX_TURN)))
    agent.reset()
    honest.reset()
    return observation, agent, honest
