"""Oracles that report something else than the truth, so that the driver comes close to cars."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from caldrive.agents.cal import CALAgent, OraclePerception
from caldrive.collection.oracles import HiddenCarsOracle, TailgatingOracle
from caldrive.control.controller import CALController, ControlConfig
from caldrive.control.patience import PatienceConfig
from caldrive.datatypes import MAX_VEHICLE_DISTANCE, Pose
from caldrive.scenarios import Scenario
from tests.fakes import StraightRoad

PATIENT = ControlConfig(patience=PatienceConfig(enabled=False), cap=20.0)
AWAY = Scenario("fake", 1, Pose(0.0, 0.0, 0.0), Pose(1000.0, 0.0, 0.0))


def road(**there: object) -> StraightRoad:
    world = StraightRoad(**there)  # type: ignore[arg-type]
    world.reset(AWAY)
    return world


def nearest(world: StraightRoad, perception: OraclePerception, seconds: float = 40.0) -> float:
    """How near the driver comes to the car ahead, in m."""
    agent, gaps = CALAgent(perception, CALController(PATIENT)), []
    observation = world.reset(AWAY)
    for _ in range(round(seconds / world.dt)):
        observation = world.step(agent.act(observation))
        gaps.append(world.truth().affordances.vehicle_distance)
    assert observation.speed < 0.3
    return min(gaps)


@pytest.mark.parametrize("gap", [0.5, 1.5, 3.0, 4.0])
def test_a_tailgating_driver_stops_at_its_gap_and_hits_nobody(gap: float) -> None:
    world = road(lead=lambda time: 80.0)
    assert 0.3 * gap < nearest(world, TailgatingOracle(world.truth, gap)) < gap + 0.8


def test_others_stop_farther_away() -> None:
    world = road(lead=lambda time: 80.0)
    assert nearest(world, OraclePerception(world.truth)) > 4.5
    assert 2.0 < nearest(world, HiddenCarsOracle(world.truth)) < 5.0


def stopping_place(world: StraightRoad, seconds: float) -> float:
    """Where the front axle of a tailgating driver stands in the end, as an arc length in m."""
    agent = CALAgent(TailgatingOracle(world.truth, 1.0), CALController(PATIENT))
    observation = world.reset(AWAY)
    for _ in range(round(seconds / world.dt)):
        observation = world.step(agent.act(observation))
    assert observation.speed < 0.3
    return world.along


def test_a_tailgating_driver_stops_for_people() -> None:
    assert stopping_place(road(person=lambda time: (50.0, 0.0)), 15.0) < 49.0


def test_a_tailgating_driver_waits_for_people_who_walk_between_it_and_a_car_that_drives_off() -> None:
    def lead(time: float) -> float:
        return 51.5 + 3.0 * max(0.0, time - 22.0)

    there = stopping_place(road(lead=lead), 20.0)
    crossed = road(lead=lead, person=lambda time: (there + 1.4, 0.0) if time > 20.0 else None)
    assert stopping_place(crossed, 26.0) < there + 0.3


@pytest.mark.parametrize("kind", [HiddenCarsOracle, lambda truth: TailgatingOracle(truth, 1.0)])
def test_on_an_empty_road_all_report_the_truth(kind: Callable[..., OraclePerception]) -> None:
    world = road(light=5.0)
    observation = world.reset(AWAY)
    reported = kind(world.truth).predict(observation)
    assert reported == world.truth().affordances
    assert reported.vehicle_distance == MAX_VEHICLE_DISTANCE
