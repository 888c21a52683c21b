"""What CARLA says in our words: with its classes in the place of a server."""

from __future__ import annotations

import math
from contextlib import nullcontext
from types import SimpleNamespace
from typing import Any

import pytest

from caldrive.carla_bridge.client.actors import Actors, lights_at_posts, place_of, transform_of
from caldrive.datatypes import ContactKind, LightState, Pose, VehicleState
from caldrive.world.roads.towns import load_roads

OFFSET = (1000.0, 2000.0)


def vector(x: float, y: float, z: float = 0.0) -> SimpleNamespace:
    return SimpleNamespace(x=x, y=y, z=z, length=lambda: math.sqrt(x * x + y * y + z * z))


def transform(pose: Pose, offset: tuple[float, float] = (0.0, 0.0)) -> Any:
    """As CARLA's, of a pose of ours."""
    return transform_of(FAKE, pose, 0.0, offset)


FAKE = SimpleNamespace(
    Location=vector,
    Rotation=lambda pitch, yaw, roll: SimpleNamespace(pitch=pitch, yaw=yaw, roll=roll),
    Transform=lambda location, rotation: SimpleNamespace(location=location, rotation=rotation),
)


class Server:
    """A connection to a world with some actors."""

    def __init__(self, **actors: list[Any]) -> None:
        self.carla, self.world = FAKE, SimpleNamespace(get_actors=lambda: self)
        self._actors = actors

    def filter(self, pattern: str) -> list[Any]:
        return self._actors.get(pattern.partition(".")[0], [])

    def answers(self) -> Any:
        return nullcontext()


def actor(id: int, pose: Pose, speed: float, size: tuple[float, float], kind: str) -> SimpleNamespace:
    forward = vector(speed * math.cos(pose.heading), -speed * math.sin(pose.heading))
    box = SimpleNamespace(location=vector(0.5, 0.0), extent=vector(size[0] / 2, size[1] / 2))
    return SimpleNamespace(
        id=id, type_id=kind, bounding_box=box, get_transform=lambda: transform(pose), get_velocity=lambda: forward
    )


def test_a_place_goes_to_carla_and_back() -> None:
    pose = Pose(12.0, 34.0, 0.7)
    there = transform(pose, OFFSET)
    assert (there.location.x, there.location.y) == pytest.approx((1012.0, -2034.0))
    assert there.rotation.yaw == pytest.approx(-math.degrees(0.7))
    back = place_of(there, OFFSET).pose
    assert (back.x, back.y, back.heading) == pytest.approx((12.0, 34.0, 0.7))


def test_a_vehicle_is_the_box_around_it_and_the_ego_is_none_of_the_others() -> None:
    pose = Pose(10.0, 20.0, math.pi / 2)
    bicycle = actor(7, pose, speed=3.0, size=(1.6, 0.0), kind="vehicle.bh.crossbike")
    ego = actor(8, pose, speed=3.0, size=(4.2, 1.8), kind="vehicle.seat.leon")
    [(found, height)] = Actors(Server(vehicle=[bicycle, ego]), load_roads("town01"), ego=8).vehicles()  # type: ignore[arg-type]
    assert (found.pose.x, found.pose.y) == pytest.approx((10.0, 20.5))  # its box lies ahead of its origin
    assert (found.speed, found.length, found.width) == pytest.approx((3.0, 1.6, 0.5))
    assert (found.id, height) == ("vehicle.bh.crossbike#7", 0.0)


def test_a_person_on_the_road_is_on_it() -> None:
    roads = load_roads("town01")
    lane = roads.driveable[0]
    on, off = lane.line.pose_at(10.0), lane.post_beside(10.0)
    walkers = [actor(k, pose, 1.2, (0.4, 0.6), "walker.pedestrian.0001") for k, pose in enumerate((on, off))]
    people = Actors(Server(walker=walkers), roads, ego=99).pedestrians()  # type: ignore[arg-type]
    assert [person.on_road for person in people] == [True, False]
    assert (people[0].speed, people[0].radius) == pytest.approx((1.2, 0.3))


def test_a_light_stands_at_the_post_where_its_traffic_stops() -> None:
    roads = load_roads("town01")
    stop = roads.lanes[roads.posts[3].lane].line
    waypoint = SimpleNamespace(transform=transform(stop.pose_at(stop.length - 1.0)))
    light = SimpleNamespace(state="Red", get_stop_waypoints=lambda: [waypoint])
    server: Any = Server(traffic=[light])
    assert [k for k, found in enumerate(lights_at_posts(server, roads)) if found is light] == [3]
    shown = Actors(server, roads, ego=0).lights()
    assert [one.id for one in shown] == [post.id for post in roads.posts]
    assert [k for k, one in enumerate(shown) if one.state is LightState.RED] == [3]  # who has none is green


def test_the_hardest_hit_counts_and_whose_fault_it_is() -> None:
    ego = VehicleState(Pose(0.0, 0.0, 0.0), speed=5.0)
    ahead = actor(3, Pose(4.5, 0.0, 0.0), 0.0, (4.5, 1.8), "vehicle.audi.tt")
    beside = actor(4, Pose(0.0, 1.2, 0.0), 1.0, (0.5, 0.5), "walker.pedestrian.0001")
    kerb = actor(0, Pose(2.0, 0.0, 0.0), 0.0, (0.2, 0.2), "static.sidewalk")
    pole = actor(0, Pose(0.0, 0.0, 0.0), 0.0, (0.2, 0.2), "static.pole")
    hits = [(ahead, 100.0), (ahead, 4000.0), (ahead, 20.0), (beside, 50.0), (kerb, 900.0), (pole, 10.0)]
    events = [SimpleNamespace(other_actor=other, normal_impulse=vector(-n, 0.0)) for other, n in hits]
    car, person, thing = Actors(Server(), load_roads("town01"), ego=1).contacts(events, ego)  # type: ignore[arg-type]
    assert (car.kind, car.impulse, car.at_fault) == (ContactKind.CAR, 4000.0, True)
    assert (person.kind, person.at_fault) == (ContactKind.PERSON, False)  # who walks into its flank
    assert (thing.kind, thing.at_fault) == (ContactKind.OBJECT, True)
