"""Cars at the kerb: where they stand; who looks can stop before one that pulls out, and who does not cannot."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
import shapely

from caldrive.datatypes import KMH, Pose, VehicleState
from caldrive.geometry import Polyline, box_corners, boxes_overlap, moved
from caldrive.world.roads.network import Lane, RoadNetwork
from caldrive.world.town import load_town
from caldrive.world.traffic.parked_cars import (
    APART,
    BESIDE,
    CLEAR_OF_EGO,
    FARTHEST,
    WAY,
    ParkedCar,
    ParkedCars,
    Stage,
    _may_begin,
    _move,
)
from caldrive.world.traffic.sumo_process import MODELS
from caldrive.world.truth.labels import hazard_stop, in_the_way, vehicle_distance

DT = 0.1
LANE = Lane("lane", Polyline(np.array([(0.0, 0.0), (200.0, 0.0)])), width=4.0, limit=30.0)
AXLE = 1.3  # m from the ego's centre to its front axle


def ego_at(x: float, speed: float) -> VehicleState:
    return VehicleState(Pose(x, 0.0, 0.0), speed, length=4.2, width=1.8, id="ego")


def parked(willing: bool = True, length: float = 4.2, width: float = 1.76) -> ParkedCar:
    return ParkedCar("parked0", length, width, LANE, s=60.0, willing=willing)


def test_nobody_begins_where_nobody_is_looked_at() -> None:
    """Farther than that along an axis a car may be left alone: nothing could begin."""
    farthest = max(
        ahead for ahead in np.arange(0, 60, 0.1) for speed in np.arange(0, 20, 0.25) if _may_begin(ahead, speed)
    )
    assert math.hypot(farthest + ego_at(0, 0).length / 2, 2 * BESIDE) < FARTHEST


def overlap(first: VehicleState, second: VehicleState) -> bool:
    boxes = (box_corners(car.pose, car.length, car.width) for car in (first, second))
    return boxes_overlap(*boxes)


def meet(
    speed: float, looks: bool, car: ParkedCar, acceleration: float = 0.0, x: float = 20.0, most: float = 0.0
) -> bool:
    """Whether an ego at x m and a speed (m/s), which speeds up (m/s²) to another one (m/s) and brakes for a hazard if
    it looks, touches the car."""
    ego, gain = ego_at(x, speed), acceleration
    for _ in range(300):
        _move(car, DT, ego, gain, [])
        state = car.state
        hazards = [state] if in_the_way(state, LANE.line, ego.pose.x) else []
        sees = hazard_stop(moved(ego.pose, forward=AXLE), hazards, ())
        faster = max(ego.speed, min(ego.speed + acceleration * DT, most))
        then = max(0.0, ego.speed - 7.5 * DT) if looks and sees else faster
        gain = (then - ego.speed) / DT
        ego = ego_at(ego.pose.x + (ego.speed + then) / 2 * DT, then)
        if overlap(ego, state):
            return True
    return False


@pytest.mark.parametrize("kmh", [10, 15, 20, 25])
@pytest.mark.parametrize(("length", "width"), [model[1:] for model in MODELS])
def test_who_looks_stops_before_a_car_that_pulls_out_and_who_does_not_runs_into_it(
    kmh: int, length: float, width: float
) -> None:
    for offset in np.linspace(0, kmh * KMH * DT, 3):
        car = parked(length=length, width=width)
        assert not meet(kmh * KMH, True, replace(car, s=60.0 + offset))
        assert meet(kmh * KMH, False, replace(car, s=60.0 + offset))


@pytest.mark.parametrize("most", [20, 30])
@pytest.mark.parametrize("acceleration", [1.0, 2.0, 3.0])
def test_who_speeds_up_behind_a_turn_and_looks_is_not_touched_either(acceleration: float, most: float) -> None:
    began = 0
    for speed in np.arange(2.5, most * KMH, 0.5):
        for x in np.arange(30.0, 56.0, 0.5):
            car = parked(length=4.8, width=1.9)
            assert not meet(float(speed), True, car, acceleration, float(x), most * KMH), (speed, x)
            began += car.stage is not Stage.PARKED
    assert began > 0


def test_who_looks_at_the_car_ahead_only_does_not_see_it() -> None:
    car = parked()
    ego = ego_at(40.0, 20 * KMH)
    while car.stage is not Stage.WAITING:
        ego = ego_at(ego.pose.x + ego.speed * DT, ego.speed)
        _move(car, DT, ego, 0.0, [])
    assert vehicle_distance(ego, moved(ego.pose, forward=AXLE), [car.state]) == 50.0


def test_it_drives_off_when_the_ego_stands() -> None:
    car = parked()
    ego, standing = ego_at(30.0, 20 * KMH), 0
    for _ in range(200):
        _move(car, DT, ego, 0.0, [])
        if car.stage is Stage.PARKED or (car.stage is Stage.PULLING_OUT and ego.speed):
            ego = ego_at(ego.pose.x + ego.speed * DT, ego.speed)
        if car.stage is Stage.WAITING:
            ego, standing = ego_at(ego.pose.x, 0.0), standing + 1
    assert standing * DT > 1.0
    assert car.stage is Stage.LEAVING
    assert car.way > WAY
    assert abs(car.state.pose.y) < 1e-6
    assert abs(car.state.pose.heading) < 1e-6


@pytest.mark.parametrize(("speed", "x", "left"), [(0.0, 50.0, 0.0), (12.0, 40.0, 0.0), (5.5, 45.0, 6.0)])
def test_nobody_pulls_out_before_who_stands_who_is_too_fast_or_who_drives_elsewhere(
    speed: float, x: float, left: float
) -> None:
    car = parked()
    for k in range(100):
        _move(car, DT, replace(ego_at(0, speed), pose=Pose(x + k * speed * DT, left, 0.0)), 0.0, [])
    assert car.stage is Stage.PARKED


def test_nobody_pulls_out_in_front_of_others() -> None:
    car, other = parked(), replace(ego_at(52.0, 5.0), id="car1")
    for k in range(60):
        _move(car, DT, ego_at(40.0 + k * 0.5, 5.5), 0.0, [other])
    assert car.stage is Stage.PARKED


def test_who_is_not_willing_stays() -> None:
    car = parked(willing=False)
    assert not meet(20 * KMH, False, car)
    assert car.way == 0


@pytest.fixture(scope="module")
def cars(town01: RoadNetwork) -> ParkedCars:
    return some(town01, seed=1)


def some(roads: RoadNetwork, seed: int) -> ParkedCars:
    ego = replace(ego_at(0, 0), pose=roads.driveable[0].line.pose_at(40.0))
    near = load_town("town01").obstacles.near
    return ParkedCars(roads, 20, np.random.default_rng(seed), ego=ego, near=near, models=MODELS)


def test_they_stand_at_the_kerb_apart_and_in_nobodys_way(cars: ParkedCars, town01: RoadNetwork) -> None:
    states = cars.states()
    assert len(states) >= 12
    places = np.array([(car.pose.x, car.pose.y) for car in states])
    distances = np.hypot(*(places[:, None] - places[None]).transpose(2, 0, 1)) + 1e9 * np.eye(len(places))
    assert distances.min() >= APART
    ego = town01.driveable[0].line.pose_at(40.0)
    assert np.hypot(*(places - (ego.x, ego.y)).T).min() >= CLEAR_OF_EGO
    for car in states:
        outline = shapely.Polygon(box_corners(car.pose, car.length, car.width))
        assert outline.intersection(town01.sidewalk).area > 0.4 * outline.area
        assert not any(
            boxes_overlap(box_corners(car.pose, car.length, car.width), box_corners(t.pose, t.length, t.width))
            for t in load_town("town01").obstacles.near(car.pose, 6.0)
        )
        lane, s = town01.lane_at(replace(car.pose, heading=car.pose.heading))
        assert lane.line.length - s > 40.0
        assert not in_the_way(car, lane.line, s)


def test_equal_seeds_park_equally(cars: ParkedCars, town01: RoadNetwork) -> None:
    assert some(town01, seed=1).states() == cars.states()
    assert some(town01, seed=2).states() != cars.states()
    assert not math.isclose(cars.states()[0].pose.x, cars.states()[1].pose.x)
