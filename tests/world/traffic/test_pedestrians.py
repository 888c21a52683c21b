"""People: where they walk, when they step onto the road, and that equal seeds give equal walks."""

from __future__ import annotations

import math

import numpy as np
import pytest
import shapely

from caldrive.datatypes import PedestrianState, Pose, VehicleState
from caldrive.geometry import boxes_of
from caldrive.world.roads.network import RoadNetwork
from caldrive.world.traffic.pedestrians import Pedestrians
from caldrive.world.traffic.sidewalks import find_sidewalks

DT = 0.1
FAR = VehicleState(Pose(-1e4, 0, 0), id="ego")  # a car where it disturbs nobody
Walk = list[tuple[PedestrianState, ...]]


def walk(people: Pedestrians, seconds: float, cars: list[VehicleState] | None = None) -> Walk:
    states = []
    for _ in range(round(seconds / DT)):
        people.step(DT, boxes_of(cars or [FAR]))
        states.append(people.states())
    return states


def people(roads: RoadNetwork, n: int, seed: int = 0, crossing: float = 1.0) -> Pedestrians:
    return Pedestrians(roads, n, np.random.default_rng(seed), crossing)


def places(walk: Walk) -> np.ndarray:
    return np.array([[(p.pose.x, p.pose.y) for p in people] for people in walk])


def crossings(walk: Walk) -> int:
    """How often somebody stepped onto the road."""
    on_road = np.array([[p.on_road for p in people] for people in walk], dtype=int)
    return int((np.diff(on_road, axis=0) > 0).sum())


@pytest.fixture(scope="module")
def busy(town02: RoadNetwork) -> Walk:
    """A minute of 60 people who cross often."""
    return walk(people(town02, 60, crossing=5.0), 60)


def test_whoever_is_on_the_roadway_is_known_to_be(busy: Walk, town02: RoadNetwork) -> None:
    at = shapely.points(places(busy[::5]).reshape(-1, 2))
    on_road = np.array([p.on_road for people in busy[::5] for p in people])
    assert not shapely.covers(town02.roadway.buffer(-0.05), at[~on_road]).any()
    away = shapely.distance(town02.roadway, at[on_road])
    assert away.max() < 1.3
    assert (away > 0.5).mean() < 0.03


def test_people_leave_neither_sidewalk_nor_road(busy: Walk, town02: RoadNetwork) -> None:
    town = town02.roadway.union(town02.sidewalk).buffer(0.1)
    assert shapely.contains_xy(town, places(busy[::5]).reshape(-1, 2)).all()


def test_nobody_jumps(busy: Walk) -> None:
    steps = np.linalg.norm(np.diff(places(busy), axis=0), axis=2)
    assert steps.max() < 1.5, "the change to another loop may skip to the middle of the sidewalk"
    assert (steps < 0.3).mean() > 0.98


def test_people_walk_at_a_walking_pace_and_look_where_they_go(busy: Walk) -> None:
    before, after = places(busy)[:-1], places(busy)[1:]
    step = after - before
    length = np.linalg.norm(step, axis=2)
    heading = np.array([[p.pose.heading for p in people] for people in busy[1:]])
    walking = (length > 0.05) & (length < 0.3)
    along = np.cos(np.arctan2(step[..., 1], step[..., 0]) - heading)
    assert 0.7 < np.median(length[walking]) / DT < 1.8
    assert np.mean(along[walking] > 0.9) > 0.97


def test_people_cross_from_one_sidewalk_to_another(town02: RoadNetwork) -> None:
    group = people(town02, 60, crossing=5.0)
    loops = group.walkers.loop.copy()
    walk(group, 40)
    assert (loops != group.walkers.loop).sum() > 5


def test_crossings_lead_straight_over_the_road_from_kerb_to_kerb(town: RoadNetwork) -> None:
    ways = [way for loop in find_sidewalks(town).crossings for way in loop]
    assert len(ways) > 200
    lines = shapely.linestrings(np.array([(way.start, way.end) for way in ways]))
    lengths, on_road = shapely.length(lines), shapely.length(shapely.intersection(lines, town.roadway))
    assert lengths.min() > 5.0
    assert lengths.max() < 23.0
    assert on_road.min() > 3.5
    assert np.percentile(lengths - on_road, 99) < 6.0, "a sidewalk's half at each end"
    ends = shapely.points(np.array([end for way in ways for end in (way.start, way.end)]))
    assert shapely.distance(ends, town.roadway).min() > 1.0


def test_equal_seeds_walk_equal_ways_and_others_do_not(town02: RoadNetwork) -> None:
    first, again, other = (places(walk(people(town02, 20, seed, 5.0), 20)) for seed in (1, 1, 2))
    assert np.array_equal(first, again)
    assert not np.allclose(first, other)


def test_people_cross_more_often_on_demand(town02: RoadNetwork) -> None:
    seldom, often = (crossings(walk(people(town02, 100, 3, factor), 30)) for factor in (0.2, 1.0))
    assert often > 2.5 * seldom > 0


def test_without_the_wish_nobody_crosses(town02: RoadNetwork) -> None:
    assert crossings(walk(people(town02, 100, 3, 0.0), 20)) == 0


def test_more_people_than_sidewalks_hold_are_refused(town02: RoadNetwork) -> None:
    with pytest.raises(ValueError, match=r"found 100000 people asked for, but town02 has room for \d+"):
        people(town02, 100_000)


def test_nobody_at_all_is_fine(town02: RoadNetwork) -> None:
    assert walk(people(town02, 0), 1)[-1] == ()


def test_people_walk_in_a_town_without_cars(town02: RoadNetwork) -> None:
    group = people(town02, 30, crossing=50.0)
    for _ in range(100):
        group.step(DT, boxes_of(()))
    assert len(group.states()) == 30


def test_nobody_is_run_over_on_a_street_where_a_fast_car_drives_up_and_down(town02: RoadNetwork) -> None:
    lane = max(town02.driveable, key=lambda lane: lane.line.length).line
    group, closest = people(town02, 80, 4, crossing=10.0), math.inf
    for i in range(300):
        pose = lane.pose_at((i * 1.2) % lane.length)
        ego = VehicleState(pose, 12.0, length=4.2, width=1.8)
        before = group.walkers.on_road.copy()
        group.step(DT, boxes_of([ego]))
        c, s = math.cos(pose.heading), math.sin(pose.heading)
        d = group.walkers.position - (pose.x, pose.y)
        stepped = group.walkers.on_road & ~before & (np.abs(-s * d[:, 0] + c * d[:, 1]) < 2.0)
        ahead = (c * d[:, 0] + s * d[:, 1] - 2.1)[stepped]
        closest = min([closest, *ahead[ahead > 0]])
    assert 12.0 < closest < 60.0  # somebody stepped out before it
