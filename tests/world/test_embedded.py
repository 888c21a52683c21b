"""The embedded world as a whole: it keeps the protocol, moves like a world, and repeats itself byte for byte."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from contextlib import closing
from dataclasses import astuple, replace
from typing import Any

import numpy as np
import pytest

from caldrive.agents.cal import CALAgent, OraclePerception
from caldrive.control.controller import CALController, ControlConfig
from caldrive.datatypes import CameraConfig, Command, ContactKind, Control, Pose, Step, Truth
from caldrive.driving.rollout import run_episode
from caldrive.geometry import moved, to_local
from caldrive.interfaces import Agent, World
from caldrive.results import Outcome
from caldrive.scenarios import Scenario
from caldrive.world.embedded import EmbeddedWorld
from caldrive.world.rendering.pinhole import camera_on
from caldrive.world.roads.network import RoadNetwork
from caldrive.world.roads.route import plan_route
from caldrive.world.roads.towns import load_roads
from caldrive.world.town import load_town
from caldrive.world.traffic.ego import VehicleConfig

NOTHING = Control()


@pytest.fixture(scope="module")
def world() -> Iterator[EmbeddedWorld]:
    """A world without a camera."""
    with closing(EmbeddedWorld()) as without_camera:
        yield without_camera


def along_the_street(start: float = 10.0, goal: float = 70.0, **more: Any) -> Scenario:
    """Straight on, on the longest lane of town02."""
    lane = max(load_roads("town02").driveable, key=lambda lane: lane.line.length).line
    limit = (goal - start) * 0.36
    first, last = lane.pose_at(start), lane.pose_at(goal)
    return Scenario("town02", weather=1, start=first, goal=last, time_limit=limit, **more)


def around_a_corner(**more: Any) -> Scenario:
    """From 30 m before a junction to 40 m behind it, to the left, in town02."""
    roads = load_roads("town02")
    for post in roads.posts:
        lane = roads.lanes[post.lane].line
        for turn in roads.lanes[post.lane].successors:
            after = roads.lanes[roads.lanes[turn].successors[0]]
            if roads.lanes[turn].turn is Command.LEFT and lane.length > 32 and not after.internal:
                start, goal = lane.pose_at(lane.length - 30), after.line.pose_at(min(25.0, after.line.length - 1))
                return Scenario("town02", weather=1, start=start, goal=goal, time_limit=60.0, **more)
    raise AssertionError("town02 has no left turn")


def oracle(world: EmbeddedWorld, cap: float | None = 20.0) -> Agent:
    return CALAgent(OraclePerception(world.truth), CALController(replace(ControlConfig(), cap=cap)))


def drive(world: World, scenario: Scenario, steps: int, control: Control) -> list[Truth]:
    """The truth at the start of an episode and after each step under a constant control."""
    world.reset(scenario)
    truths = [world.truth()]
    for _ in range(steps):
        world.step(control)
        truths.append(world.truth())
    return truths


def test_an_episode_begins_at_rest_at_its_start_at_time_0(world: EmbeddedWorld) -> None:
    protocol: World = world
    scenario = along_the_street()
    observation, truth = protocol.reset(scenario), protocol.truth()
    assert (observation.time, observation.speed, observation.command) == (0.0, 0.0, Command.STRAIGHT)
    assert observation.image.shape == (1, 1, 3)
    assert (truth.ego.pose.x, truth.ego.pose.y) == pytest.approx((scenario.start.x, scenario.start.y), abs=0.05)
    assert (truth.route_done, truth.contacts, truth.vehicles, truth.pedestrians) == (0.0, (), (), ())
    assert truth.route_length == pytest.approx(60.0, abs=0.2)
    assert truth.goal_distance == pytest.approx(60.0, abs=0.2)


def test_the_scenario_decides_how_many_are_around(world: EmbeddedWorld) -> None:
    (truth,) = drive(world, along_the_street(n_vehicles=7, n_pedestrians=11), 0, NOTHING)
    drivers = [car for car in truth.vehicles if not car.id.startswith("parked")]
    assert (len(drivers), len(truth.pedestrians), len(truth.lights)) == (7, 11, 24)
    assert len(truth.vehicles) - len(drivers) == round(0.6 * 7)
    assert not drive(world, along_the_street(), 0, NOTHING)[0].vehicles


def test_time_goes_on_by_dt_and_observation_and_truth_agree(world: EmbeddedWorld) -> None:
    world.reset(along_the_street())
    for i in range(1, 20):
        observation, truth = world.step(Control(throttle=0.5)), world.truth()
        assert observation.time == truth.time == pytest.approx(i * world.dt)
        assert observation.speed == truth.ego.speed


def test_no_step_moves_the_car_further_than_its_speed_allows(world: EmbeddedWorld) -> None:
    truths = drive(world, along_the_street(n_vehicles=10), 60, Control(throttle=1.0, steer=0.05))
    for before, after in itertools.pairwise(truths):
        way = math.hypot(after.ego.pose.x - before.ego.pose.x, after.ego.pose.y - before.ego.pose.y)
        pushed = 0.5 if after.contacts else 0.0
        assert way <= max(before.ego.speed, after.ego.speed) * world.dt * 1.02 + pushed
    assert max(truth.ego.speed for truth in truths) > 5


def test_without_throttle_the_car_stays(world: EmbeddedWorld) -> None:
    truths = drive(world, along_the_street(), 20, NOTHING)
    assert truths[-1].ego.pose == truths[0].ego.pose
    assert truths[-1].affordances == truths[0].affordances


def test_progress_grows_and_the_goal_comes_closer(world: EmbeddedWorld) -> None:
    truths = drive(world, along_the_street(), 50, Control(throttle=0.6))
    done = [truth.route_done for truth in truths]
    assert done == sorted(done)
    assert 10 < done[-1] < 60
    assert truths[-1].goal_distance == pytest.approx(60 - done[-1], abs=0.3)


def test_the_progress_ends_at_the_goal(world: EmbeddedWorld) -> None:
    truths = drive(world, along_the_street(goal=25.0), 70, Control(throttle=0.6))
    assert truths[-1].route_done == truths[-1].route_length == pytest.approx(15.0, abs=0.1)
    assert truths[-1].goal_distance > 5


def test_the_lawful_limit_changes_at_the_signs(world: EmbeddedWorld, town01: RoadNetwork) -> None:
    fast = next(sign for sign in town01.signs if sign.limit == 60)
    lane, _s = town01.lane_at(moved(fast.pose, left=3.1))
    before = next(
        each for each in town01.driveable if lane.id in each.successors or via_leads_to(town01, each.id, lane.id)
    )
    start = before.line.pose_at(before.line.length - 10)
    scenario = Scenario("town01", weather=1, start=start, goal=lane.line.pose_at(lane.line.length - 1))
    truths = drive(world, scenario, 70, Control(throttle=0.8))
    there = plan_route(town01, start, scenario.goal).line.project(fast.pose.x, fast.pose.y).s
    assert (
        {round(truth.speed_limit) for truth in truths if truth.route_done < there - 0.5}
        == {round(before.limit)}
        != {60}
    )
    assert {truth.speed_limit for truth in truths if there + 0.5 < truth.route_done < there + 5} == {60.0}


def via_leads_to(roads: RoadNetwork, first: str, last: str) -> bool:
    return any(last in roads.lanes[via].successors for via in roads.lanes[first].successors)


def test_a_car_that_leaves_the_road_meets_something_solid(world: EmbeddedWorld) -> None:
    truths = drive(world, along_the_street(), 100, Control(throttle=0.7, steer=-0.25))
    assert max(truth.sidewalk_share for truth in truths) > 0.5
    hits = [contact for truth in truths for contact in truth.contacts]
    assert ContactKind.OBJECT in {contact.kind for contact in hits}
    assert max(contact.impulse for contact in hits) > 400


def test_a_long_vehicle_meets_what_stands_far_from_its_middle() -> None:
    town = load_town("town02")
    lane = max(town.roads.driveable, key=lambda lane: lane.line.length).line
    places = [lane.project(prop.pose.x, prop.pose.y) for prop in town.scenery if prop.kind == "lamp"]
    lamp = next(place for place in places if -3.5 < place.left < -2.0 and 20 < place.s < lane.length - 30)
    with closing(EmbeddedWorld(vehicle=VehicleConfig(length=14.0))) as world:
        world.reset(along_the_street(start=lamp.s - 6.0, goal=lamp.s + 20.0))
        world.displace(left=lamp.left, turn=0.0)
        world.step(NOTHING)
        assert any(contact.id.startswith("lamp") for contact in world.truth().contacts)


def test_a_car_that_turned_around_in_its_lane_drives_on_the_opposite_one(world: EmbeddedWorld) -> None:
    world.reset(along_the_street())
    world.displace(left=0.0, turn=math.radians(50.0))
    assert world.truth().opposite_share < 0.2
    world.displace(left=0.0, turn=math.radians(130.0))
    assert world.truth().opposite_share > 0.9


def test_a_car_across_the_centre_line_is_on_the_opposite_lane(world: EmbeddedWorld) -> None:
    truths = drive(world, along_the_street(), 60, Control(throttle=0.5, steer=0.08))
    assert truths[0].opposite_share == 0.0
    assert max(truth.opposite_share for truth in truths) > 0.4


def test_the_command_comes_before_the_junction_and_goes_behind_it(world: EmbeddedWorld) -> None:
    commands = [step.observation.command for step in run_steps(world, around_a_corner())]
    changes = [a for a, b in zip(commands, [None, *commands], strict=False) if a is not b]
    assert changes == [Command.STRAIGHT, Command.LEFT, Command.STRAIGHT]


def run_steps(world: EmbeddedWorld, scenario: Scenario, cap: float | None = 20.0) -> list[Step]:
    steps: list[Step] = []
    run_episode(world, oracle(world, cap), scenario, steps.append)
    return steps


def test_the_oracle_drives_straight_to_its_goal_in_time(world: EmbeddedWorld) -> None:
    result = run_episode(world, oracle(world), along_the_street())
    assert result.outcome is Outcome.SUCCESS
    assert result.infractions == ()


def test_the_oracle_turns_left_at_a_light_and_breaks_no_rule(world: EmbeddedWorld) -> None:
    result = run_episode(world, oracle(world), around_a_corner())
    assert result.outcome is Outcome.SUCCESS
    assert result.infractions == ()


def test_labels_beside_the_car_differ_by_what_the_camera_is_off(world: EmbeddedWorld) -> None:
    drive(world, along_the_street(n_vehicles=10, n_pedestrians=20), 30, Control(throttle=0.4))
    true = world.truth().affordances
    assert world.labels_at(CameraConfig()) == true
    for left in (-0.5, 0.5):
        beside = world.labels_at(CameraConfig(left=left))
        assert beside.center_distance == pytest.approx(true.center_distance - left, abs=0.01)
        assert beside.relative_angle == pytest.approx(true.relative_angle, abs=0.01)
    for yaw in (-0.2, 0.2):
        turned = world.labels_at(CameraConfig(yaw=yaw))
        assert turned.relative_angle == pytest.approx(true.relative_angle - yaw, abs=0.01)


@pytest.mark.parametrize("yaw", [-0.25, 0.1])
def test_a_turned_camera_has_the_labels_of_a_car_whose_camera_takes_the_same_picture(
    world: EmbeddedWorld, yaw: float
) -> None:
    drive(world, along_the_street(n_vehicles=10, n_pedestrians=20), 30, Control(throttle=0.4))
    mount = CameraConfig(left=0.5, yaw=yaw)
    camera, labels = camera_on(world.truth().ego, mount).pose, world.labels_at(mount)
    car = to_local(world.truth().ego.pose, np.array([astuple(moved(camera, forward=-mount.forward))[:2]]))[0]
    world.displace(float(car[1]), yaw)
    own = camera_on(world.truth().ego, CameraConfig()).pose
    assert to_local(camera, np.array([astuple(own)[:2]]))[0] == pytest.approx((-float(car[0]), 0.0), abs=0.06)
    true = world.truth().affordances
    assert true.center_distance == pytest.approx(labels.center_distance, abs=0.01)
    assert true.relative_angle == pytest.approx(labels.relative_angle, abs=0.01)


def test_two_episodes_of_one_scenario_are_equal(world: EmbeddedWorld) -> None:
    scenario = along_the_street(n_vehicles=15, n_pedestrians=50, seed=3)
    first = drive(world, scenario, 60, Control(throttle=0.3))
    drive(world, along_the_street(n_vehicles=5, seed=8), 20, Control(throttle=0.3))
    assert drive(world, scenario, 60, Control(throttle=0.3)) == first


def test_another_seed_is_another_episode(world: EmbeddedWorld) -> None:
    third, fourth = (
        drive(world, along_the_street(n_vehicles=15, n_pedestrians=50, seed=seed), 0, NOTHING)[0] for seed in (3, 4)
    )
    assert third.vehicles != fourth.vehicles
    assert third.pedestrians != fourth.pedestrians
    assert third.ego == fourth.ego


def test_a_closed_world_can_be_entered_again(world: EmbeddedWorld) -> None:
    scenario = along_the_street(n_vehicles=5)
    first = drive(world, scenario, 5, NOTHING)
    world.close()
    world.close()
    assert drive(world, scenario, 5, NOTHING) == first


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"weather": 99}, "weather"),
        ({"town": "Paris"}, "found town 'Paris'"),
        ({"start": Pose(-500.0, 0.0, 0.0)}, "found no lane"),
        ({"n_vehicles": 5000}, "cars asked for"),
        ({"n_pedestrians": 50_000}, "people asked for"),
    ],
)
def test_a_scenario_that_cannot_be_is_refused(change: dict[str, Any], message: str, world: EmbeddedWorld) -> None:
    with pytest.raises(ValueError, match=message):
        world.reset(replace(along_the_street(), **change))
