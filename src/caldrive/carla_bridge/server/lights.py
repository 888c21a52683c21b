"""Traffic lights as CARLA's actors: what they show, how clients hold and freeze them, and who stands before them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from caldrive.carla_bridge.axes import standing
from caldrive.carla_bridge.server.actors import Actor, description
from caldrive.carla_bridge.server.layouts import BoundingBox, Vector
from caldrive.carla_bridge.server.snapshot import Triple, light_part
from caldrive.datatypes import LightState, Points, Pose, TrafficLight
from caldrive.geometry import moved, to_local
from caldrive.world.roads.network import LightPost, RoadNetwork
from caldrive.world.traffic.traffic_lights import TrafficLights

NUMBERS = {LightState.RED: 0, LightState.YELLOW: 1, LightState.GREEN: 2}
STATES = {number: state for state, number in NUMBERS.items()}
USUAL_TIMES: Triple = (10.0, 3.0, 2.0)  # s of green, yellow, red that a client's state lasts
TRIGGER = 2.5  # m: half the length of a trigger volume, which ends at the stop line
ZONE = 12.0  # m before a stop line within which a vehicle is at the light
SAME_WAY = 0.7  # cosine of the angle to its traffic


@dataclass(eq=False)
class Light(Actor):
    """One light."""

    post: LightPost = field(kw_only=True)
    number: int = field(kw_only=True)
    """Of its post, among those of its junction."""
    times: Triple = USUAL_TIMES
    state: LightState = LightState.RED
    since: float = 0.0
    """s: when it began to show this."""
    held: tuple[LightState, float] | None = None
    """What a client wants it to show, and since when (s)."""

    @property
    def holds_until(self) -> float:
        """s: what a client wants lasts as long as the light's time for it, which may be set later."""
        assert self.held is not None
        state, since = self.held
        return since + self.times[(LightState.GREEN, LightState.YELLOW, LightState.RED).index(state)]


def light_actors(roads: RoadNetwork, numbers: Iterator[int], ids: dict[str, str]) -> list[Light]:
    """The lights of a town. numbers: for actors; ids: on the map, by those of their posts."""
    counted: dict[str, int] = {}
    lights = []
    for post in roads.posts:
        k = counted.get(post.light, 0)
        counted[post.light] = k + 1
        facing = moved(post.stands_at, turn=-math.pi / 2)  # x runs across the road, as in CARLA
        lane = roads.lanes[post.lane]
        at = to_local(facing, _point(moved(lane.line.pose_at(lane.line.length), forward=-TRIGGER))).tolist()
        box = BoundingBox(Vector(at[0], -at[1], 0.5), Vector(lane.width / 2, TRIGGER, 1.0))
        lights.append(
            Light(next(numbers), description("traffic.traffic_light"), standing(facing), box=box,
                  sign=ids.get(post.id, ""), post=post, number=k)
        )  # fmt: skip
    return lights


def _point(pose: Pose) -> Points:
    return np.array((pose.x, pose.y))


class LightKeeper:
    """Passes on between a town's lights and their actors."""

    def __init__(self, actors: Sequence[Light], lights: TrafficLights) -> None:
        self.actors, self._lights = list(actors), lights
        self._stops = np.array([np.mean(one.post.stop_line, axis=0) for one in actors]).reshape(-1, 2)
        headings = np.array([one.post.pose.heading for one in actors])
        self._cosines, self._sines = np.cos(headings), np.sin(headings)
        self.update(0.0)

    def of_junction(self, light: Light) -> list[Light]:
        """A light and the others of its junction."""
        return [one for one in self.actors if one.post.light == light.post.light]

    def is_frozen(self, light: Light) -> bool:
        """Whether its junction stays as it is."""
        return light.post.light in self._lights.frozen

    def hold(self, light: Light, state: LightState, time: float) -> None:
        """A light shows what a client wants, for the time that it has for this."""
        light.held = state, time
        self._pass_on(light.post.light)
        self.update(time)

    def freeze(self, light: Light, is_frozen: bool) -> None:
        """The lights of its junction stay as they are, or go on."""
        if is_frozen:
            self._lights.frozen.add(light.post.light)
        else:
            self._lights.frozen.discard(light.post.light)

    def release(self, lights: Iterable[Light], time: float) -> None:
        """Lights do as they would alone."""
        for light in lights:
            light.held = None
            self._pass_on(light.post.light)
        self.update(time)

    def update(self, time: float) -> None:
        """Takes down what the lights show, and ends what clients wanted where its time is over."""
        for light in self.actors:
            if light.held is not None and time > light.holds_until and not self.is_frozen(light):
                light.held = None
                self._pass_on(light.post.light)
        shown = {light.id: light.state for light in self.shown()}
        for light in self.actors:
            if shown[light.post.id] is not light.state:
                light.state, light.since = shown[light.post.id], time

    def shown(self) -> tuple[TrafficLight, ...]:
        """All lights as the embedded world knows them."""
        return self._lights.states()

    def _pass_on(self, junction: str) -> None:
        held = {one.number: one.held[0] for one in self.actors if one.post.light == junction and one.held}
        self._lights.junctions[junction].hold(held)

    def before(self, poses: Sequence[Pose]) -> list[Light | None]:
        """The light that each of some vehicles is at."""
        if not poses or not self.actors:
            return [None] * len(poses)
        x, y, c, s = np.array([(pose.x, pose.y, math.cos(pose.heading), math.sin(pose.heading)) for pose in poses]).T[
            ..., None
        ]
        dx, dy = x - self._stops[:, 0], y - self._stops[:, 1]
        ahead, left = dx * self._cosines + dy * self._sines, dy * self._cosines - dx * self._sines
        inside = (ahead > -ZONE) & (ahead < 0.5) & (np.abs(left) < 2.0)
        inside &= c * self._cosines + s * self._sines > SAME_WAY
        at = np.where(inside.any(axis=1), inside.argmax(axis=1), -1).tolist()
        return [self.actors[k] if k >= 0 else None for k in at]

    def part(self, light: Light, time: float) -> bytes:
        """What a light adds to a snapshot."""
        return light_part(
            light.sign, light.times, time - light.since, light.number, self.is_frozen(light), NUMBERS[light.state]
        )
