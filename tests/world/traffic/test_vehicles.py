"""The other cars: they keep to their lanes and to the lights, keep apart, and stop for people and for the ego."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import libsumo
import numpy as np
import pytest
from shapely import LineString

from caldrive.datatypes import LightState, PedestrianState, Pose, TrafficLight, VehicleState
from caldrive.geometry import box_corners, boxes_of, boxes_overlap, moved, to_local, wrap_angle
from caldrive.world.roads.network import Lane, RoadNetwork
from caldrive.world.traffic.start_places import room
from caldrive.world.traffic.sumo_process import stop_sumo
from caldrive.world.traffic.traffic_lights import TrafficLights
from caldrive.world.traffic.vehicles import Traffic, in_sight

DT = 0.1
Cars = tuple[VehicleState, ...]
AWAY = VehicleState(
    Pose(-400.0, -400.0, 0.0), speed=0.0, length=4.2, width=1.8, id="ego"
)  # an ego that is in nobody's way


@dataclass(frozen=True)
class Snapshot:
    """The cars and the lights at a time in s."""

    time: float
    cars: Cars
    lights: tuple[TrafficLight, ...]


def ego_on(lane: Lane, s: float, speed: float = 0.0) -> VehicleState:
    return VehicleState(lane.line.pose_at(s), speed, length=4.2, width=1.8, id="ego")


def longest_lane(roads: RoadNetwork) -> Lane:
    return max(roads.driveable, key=lambda lane: lane.line.length)


def drive(
    roads: RoadNetwork,
    n: int,
    seconds: float,
    seed: int = 1,
    ego: VehicleState = AWAY,
    people: Callable[[Cars], Sequence[PedestrianState]] = lambda _: (),
) -> list[Snapshot]:
    """Traffic for some seconds, with an ego that does not move."""
    lights = TrafficLights(roads, np.random.default_rng(seed))
    start = ego_on(longest_lane(roads), 10.0) if ego is AWAY else ego
    traffic = Traffic(roads, n=n, seed=seed, dt=DT, ego=start, lights=lights)
    snapshots = []
    for i in range(round(seconds / DT)):
        time = round((i + 1) * DT, 6)
        lights.step(time, boxes_of((ego, *traffic.cars)))
        traffic.step(time, ego, people(traffic.cars))
        snapshots.append(Snapshot(time, traffic.cars, lights.states()))
    return snapshots


@pytest.fixture(scope="module", autouse=True)
def _end_of_sumo() -> Iterator[None]:
    yield
    stop_sumo()


@pytest.fixture(scope="module")
def usual(town02: RoadNetwork) -> list[Snapshot]:
    """A minute of the protocol's 15 cars."""
    return drive(town02, 15, 60)


@pytest.fixture(scope="module")
def dense(town01: RoadNetwork) -> list[Snapshot]:
    """Two minutes of 100 cars."""
    return drive(town01, 100, 120)


def paths(snapshots: list[Snapshot]) -> dict[str, list[VehicleState]]:
    """The states of each car, one after the other, by its id."""
    by_car: dict[str, list[VehicleState]] = {}
    for snapshot in snapshots:
        for car in snapshot.cars:
            by_car.setdefault(car.id, []).append(car)
    return by_car


def overlaps(cars: Cars) -> list[tuple[str, str]]:
    at = np.array([(c.pose.x, c.pose.y) for c in cars])
    near = np.argwhere(np.triu(np.linalg.norm(at[:, None] - at, axis=2) < 6.0, 1))
    # A hand's breadth is let off: SUMO keeps lanes free, not boxes, where lanes part and meet.
    corners = [box_corners(c.pose, c.length - 0.1, c.width - 0.3) for c in cars]
    return [(cars[i].id, cars[j].id) for i, j in near if boxes_overlap(corners[i], corners[j])]


def test_all_cars_are_there_from_the_start_and_stay(usual: list[Snapshot], dense: list[Snapshot]) -> None:
    assert {len(snapshot.cars) for snapshot in usual} == {15}
    assert min(len(snapshot.cars) for snapshot in dense) >= 97
    assert {car.id for car in usual[0].cars} == {f"car{i}" for i in range(15)}


def test_the_ego_is_none_of_the_other_cars(usual: list[Snapshot]) -> None:
    assert all(car.id != "ego" for car in usual[-1].cars)


def test_cars_follow_the_centre_lines_of_their_lanes(usual: list[Snapshot], town02: RoadNetwork) -> None:
    for snapshot in usual[::20]:
        for car in snapshot.cars:
            hits = [lane.line.project(car.pose.x, car.pose.y) for lane in town02.lanes.values()]
            off = [abs(hit.left) for hit in hits if abs(wrap_angle(hit.heading - car.pose.heading)) < 0.6]
            assert min(off) < 0.8


def test_a_car_moves_along_its_heading_at_its_speed(usual: list[Snapshot]) -> None:
    for path in paths(usual).values():
        for before, after in pairwise(path):
            ahead, left = to_local(before.pose, np.array([after.pose.x, after.pose.y]))
            assert ahead == pytest.approx((before.speed + after.speed) / 2 * DT, abs=0.35)
            assert abs(left) < 0.5


def test_cars_keep_to_the_limit_and_brake_and_accelerate_like_cars(usual: list[Snapshot], town02: RoadNetwork) -> None:
    fastest = max(lane.limit for lane in town02.driveable) / 3.6
    for path in paths(usual).values():
        speeds = np.array([car.speed for car in path])
        assert speeds.max() < 1.2 * fastest
        assert np.abs(np.diff(speeds)).max() < 9.1 * DT + 1e-6


@pytest.mark.parametrize("recording", ["usual", "dense"])
def test_no_two_cars_overlap(recording: str, request: pytest.FixtureRequest) -> None:
    snapshots: list[Snapshot] = request.getfixturevalue(recording)
    assert [pair for snapshot in snapshots[::5] for pair in overlaps(snapshot.cars)] == []


@pytest.mark.parametrize("recording", ["usual", "dense"])
def test_cars_stop_at_red(recording: str, request: pytest.FixtureRequest) -> None:
    snapshots: list[Snapshot] = request.getfixturevalue(recording)
    crossed = dict.fromkeys(LightState, 0)
    lines = np.array([light.stop_line for light in snapshots[0].lights])
    for before, after in pairwise(snapshots):
        places = {car.id: moved(car.pose, car.length / 2) for car in before.cars}
        for car in after.cars:
            a, b = places.get(car.id), moved(car.pose, car.length / 2)
            if a is None:
                continue
            for k in np.flatnonzero(np.abs(lines[:, 0] - (a.x, a.y)).sum(1) < 6):
                light = before.lights[k]
                if math.cos(a.heading - light.pose.heading) > 0.7:
                    crossed[light.state] += LineString([(a.x, a.y), (b.x, b.y)]).crosses(LineString(lines[k]))
    assert crossed[LightState.RED] == 0
    assert crossed[LightState.GREEN] > 5


def test_nobody_stands_for_ever_where_the_town_is_full(dense: list[Snapshot]) -> None:
    moving = {name: [car.speed > 0.5 for car in path] for name, path in paths(dense).items()}
    assert all(any(when[-900:]) for when in moving.values()), "who stood for 90 s is stuck"
    assert np.mean([when[-1] for when in moving.values()]) > 0.3


def test_cars_drive_through_the_whole_town(dense: list[Snapshot], town01: RoadNetwork) -> None:
    ways = {
        name: sum(math.hypot(b.pose.x - a.pose.x, b.pose.y - a.pose.y) for a, b in pairwise(path))
        for name, path in paths(dense).items()
    }
    assert min(ways.values()) > 20
    assert np.mean(list(ways.values())) > 300
    at = np.array([(car.pose.x, car.pose.y) for car in dense[-1].cars])
    x0, y0, x1, y1 = town01.bounds
    assert np.ptp(at[:, 0]) > 0.8 * (x1 - x0)
    assert np.ptp(at[:, 1]) > 0.8 * (y1 - y0)


def test_equal_seeds_give_equal_traffic_and_others_do_not(town02: RoadNetwork, usual: list[Snapshot]) -> None:
    again, other = (drive(town02, 15, 15, seed)[-1].cars for seed in (1, 2))
    assert again == usual[149].cars
    assert {car.pose for car in other}.isdisjoint(car.pose for car in again)


def test_more_cars_than_the_town_holds_are_refused(town02: RoadNetwork) -> None:
    with pytest.raises(ValueError, match=r"found 5000 cars asked for, but town02 has room for \d+"):
        drive(town02, 5000, 0)


def test_a_town_holds_as_many_cars_as_it_says_wherever_the_ego_stands(town02: RoadNetwork) -> None:
    for lane in town02.driveable:
        assert len(drive(town02, room(town02), 0.1, ego=ego_on(lane, lane.line.length / 2))[0].cars) > 100


def test_nobody_starts_on_top_of_the_ego(town02: RoadNetwork) -> None:
    ego = ego_on(longest_lane(town02), 20.0)
    for seed in range(5):
        first = drive(town02, 40, 0.1, seed, ego)[0]
        assert min(math.hypot(c.pose.x - ego.pose.x, c.pose.y - ego.pose.y) for c in first.cars) > 15.0


def test_cars_queue_behind_a_standing_ego(town02: RoadNetwork) -> None:
    lane = longest_lane(town02)
    ego = ego_on(lane, 60.0)
    snapshots = drive(town02, 40, 45, ego=ego)
    assert not any(overlaps((ego, *snapshot.cars)) for snapshot in snapshots)
    places = [to_local(ego.pose, np.array([c.pose.x, c.pose.y])) for c in snapshots[-1].cars if c.speed < 0.1]
    queue = sorted(-x for x, y in places if -25 < x < 0 and abs(y) < 1.0)
    assert queue
    assert 4.2 < queue[0] < 9.0


def someone_before(car: VehicleState, ahead: float) -> PedestrianState:
    pose = moved(car.pose, forward=car.length / 2 + ahead)
    return PedestrianState(Pose(pose.x, pose.y, pose.heading + math.pi / 2), 0.0, on_road=True, id="person")


def test_a_car_stops_for_somebody_on_the_road_and_then_drives_on(town02: RoadNetwork) -> None:
    lane = longest_lane(town02)
    met: list[tuple[str, PedestrianState]] = []

    def step_out(cars: Cars) -> Sequence[PedestrianState]:
        """Somebody steps out 18 m before the first car that drives fast in the middle of the longest lane."""
        for car in cars if not met else ():
            hit = lane.line.project(car.pose.x, car.pose.y)
            if abs(hit.left) < 0.5 and 6 < hit.s < lane.line.length - 25 and car.speed > 7:
                met.append((car.id, someone_before(car, 18.0)))
        stood.extend(met[:1])
        return [met[0][1]] if 0 < len(stood) <= 100 else ()

    stood: list[tuple[str, PedestrianState]] = []
    snapshots = drive(town02, 30, 60, people=step_out)
    name, person = met[0]
    path = paths(snapshots)[name]
    ahead = [float(to_local(car.pose, np.array([person.pose.x, person.pose.y]))[0]) - car.length / 2 for car in path]
    begin = next(i for i, car in enumerate(path) if abs(ahead[i] - 18.0) < 2.0 and car.speed > 5)
    assert min(ahead[begin : begin + 95]) > 0.5
    assert path[begin + 90].speed < 0.5
    assert max(car.speed for car in path[begin + 110 : begin + 200]) > 2.0


def test_nobody_brakes_for_people_on_the_sidewalk(town02: RoadNetwork, usual: list[Snapshot]) -> None:
    onlookers = [someone_before(car, 6.0) for car in usual[0].cars]
    calm = [PedestrianState(p.pose, 0.0, on_road=False, id=p.id) for p in onlookers]
    assert drive(town02, 15, 10, people=lambda _: calm)[-1].cars == usual[99].cars


@pytest.mark.parametrize(
    ("ahead", "left", "seen"), [(60, 0, True), (80, 0, False), (-20, 0, True), (-30, 0, False), (10, 40, False)]
)
def test_stuck_cars_are_moved_only_where_the_ego_does_not_look(ahead: float, left: float, seen: bool) -> None:
    ego = VehicleState(Pose(5, 5, math.pi / 2), id="ego")
    assert in_sight(ego, (5 - left, 5 + ahead)) is seen


def test_more_cars_than_fit_are_refused_before_anything_grows_with_their_number(town02: RoadNetwork) -> None:
    lights = TrafficLights(town02, np.random.default_rng(0))
    with pytest.raises(ValueError, match="found 1000000000000 cars asked for, but town02 has room for"):
        Traffic(town02, n=10**12, seed=0, dt=DT, ego=AWAY, lights=lights)


def test_a_car_that_is_stuck_is_moved_elsewhere(town02: RoadNetwork, monkeypatch: pytest.MonkeyPatch) -> None:
    removed, remove = list[str](), libsumo.vehicle.remove

    def note(name: str) -> None:
        removed.append(name)
        remove(name)

    monkeypatch.setattr("caldrive.world.traffic.vehicles.LONGEST_WAIT", 1.0)
    monkeypatch.setattr(libsumo.vehicle, "remove", note)
    snapshots = drive(town02, 15, 30.0)
    assert removed
    assert {car.id for car in snapshots[-1].cars} == {f"car{k}" for k in range(15)}
