"""CARLA's vehicles, walkers, lights and collisions in the words of the labels and of the referee."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import numpy as np
import shapely

from caldrive.carla_bridge.axes import Placement, from_carla, standing, to_carla
from caldrive.carla_bridge.client.connection import Connection
from caldrive.datatypes import (
    Contact,
    ContactKind,
    LightState,
    PedestrianState,
    Points,
    Pose,
    TrafficLight,
    VehicleState,
)
from caldrive.geometry import moved
from caldrive.world.roads.network import LightPost, RoadNetwork
from caldrive.world.traffic.collisions import Obstacle, at_fault

THINNEST = 0.5  # m: some boxes of CARLA's bicycles have no width
STATES = {"Red": LightState.RED, "Yellow": LightState.YELLOW}  # a light that is off stops nobody
STOP_REACH, SAME_WAY = 8.0, 0.7  # m from a light's stop line to our post's, and cosine between their traffic
KINDS = {"vehicle": ContactKind.CAR, "walker": ContactKind.PERSON}
GROUND = tuple(f"static.{kind}" for kind in ("road", "roadline", "sidewalk", "ground", "terrain"))  # kerbs are no hits
Offset = tuple[float, float]


def place_of(transform: Any, offset: Offset) -> Placement:
    """A transform of CARLA's in our axes. offset: the map's, see `RoadNetwork.offset`."""
    at, turned = transform.location, transform.rotation
    return from_carla(at.x - offset[0], at.y + offset[1], at.z, turned.pitch, turned.yaw, turned.roll)


def transform_of(carla: Any, pose: Pose, height: float, offset: Offset) -> Any:
    """The inverse, for what stands upright so many m above the ground."""
    x, y, z, pitch, yaw, roll = to_carla(standing(Pose(pose.x + offset[0], pose.y + offset[1], pose.heading), height))
    return carla.Transform(carla.Location(x, y, z), carla.Rotation(pitch, yaw, roll))


def forward_speed(velocity: Any, heading: float) -> float:
    """m/s along a heading of ours."""
    return float(velocity.x * math.cos(heading) - velocity.y * math.sin(heading))


class Actors:
    """All but the ego. Their boxes are asked for once."""

    def __init__(self, connection: Connection, roads: RoadNetwork, ego: int) -> None:
        self._connection, self._roads, self._ego = connection, roads, ego
        self._boxes: dict[int, Any] = {}
        self._at_posts = lights_at_posts(connection, roads)
        shapely.prepare(roads.roadway)

    def _of_kind(self, pattern: str) -> Iterator[tuple[Any, Any, Placement]]:
        """Actors of a kind, their boxes and the places of these."""
        for actor in self._connection.world.get_actors().filter(pattern):
            if actor.id == self._ego:
                continue
            if actor.id not in self._boxes:
                self._boxes[actor.id] = actor.bounding_box
            yield actor, self._boxes[actor.id], place_of(actor.get_transform(), self._roads.offset)

    def vehicles(self) -> list[tuple[VehicleState, float]]:
        """With the height at which each drives, m."""
        found = []
        for actor, box, place in self._of_kind("vehicle.*"):
            pose = moved(place.pose, forward=box.location.x, left=-box.location.y)
            speed = forward_speed(actor.get_velocity(), pose.heading)
            length, width = 2 * box.extent.x, max(2 * box.extent.y, THINNEST)
            found.append((VehicleState(pose, speed, length=length, width=width, id=_name(actor)), place.z))
        return found

    def pedestrians(self) -> tuple[PedestrianState, ...]:
        """Everybody on foot."""
        people = list(self._of_kind("walker.*"))
        at = np.array([(place.x, place.y) for _, _, place in people]).reshape(-1, 2)
        on_road = shapely.contains_xy(self._roads.roadway, at[:, 0], at[:, 1]).tolist()
        return tuple(
            PedestrianState(
                place.pose,
                speed=forward_speed(actor.get_velocity(), place.heading),
                radius=max(box.extent.x, box.extent.y),
                on_road=on,
                id=_name(actor),
            )
            for (actor, box, place), on in zip(people, on_road, strict=True)
        )

    def lights(self) -> tuple[TrafficLight, ...]:
        """In the order of the roads' posts. A post without a light of CARLA's is always green."""
        return tuple(
            TrafficLight(post.id, post.pose, _shown(light), post.stop_line)
            for post, light in zip(self._roads.posts, self._at_posts, strict=True)
        )

    def contacts(self, hits: Iterable[Any], ego: VehicleState) -> tuple[Contact, ...]:
        """What collision events say: one for each thing, the hardest. ego: before they happened."""
        found: dict[str, Contact] = {}
        for hit in hits:
            other, impulse = hit.other_actor, hit.normal_impulse.length()
            if other.type_id in GROUND:
                continue
            kind = KINDS.get(other.type_id.partition(".")[0], ContactKind.OBJECT)
            name = _name(other)
            if name not in found or impulse > found[name].impulse:
                there = place_of(other.get_transform(), self._roads.offset).pose
                speed = 0.0 if kind is ContactKind.OBJECT else forward_speed(other.get_velocity(), there.heading)
                fault = at_fault(ego, Obstacle(kind, name, there, length=0.0, width=0.0, speed=speed))
                found[name] = Contact(kind, name, impulse, at_fault=fault)
        return tuple(found.values())


def _name(actor: Any) -> str:
    return f"{actor.type_id}#{actor.id}"


def _shown(light: Any) -> LightState:
    return LightState.GREEN if light is None else STATES.get(str(light.state), LightState.GREEN)


def lights_at_posts(connection: Connection, roads: RoadNetwork) -> list[Any]:
    """The light of CARLA's for each of the roads' posts, None where there is none: by where its traffic stops."""
    stops = []
    with connection.answers():
        for light in connection.world.get_actors().filter("traffic.traffic_light*"):
            stops += [(light, place_of(one.transform, roads.offset).pose) for one in light.get_stop_waypoints()]
    return [_nearest(post, stops) for post in roads.posts]


def _nearest(post: LightPost, stops: Sequence[tuple[Any, Pose]]) -> Any:
    middle: Points = np.mean(post.stop_line, axis=0)
    near = [
        (math.hypot(stop.x - middle[0], stop.y - middle[1]), k)
        for k, (_, stop) in enumerate(stops)
        if math.cos(stop.heading - post.pose.heading) > SAME_WAY
    ]
    distance, k = min(near, default=(math.inf, 0))
    return stops[k][0] if distance < STOP_REACH else None
