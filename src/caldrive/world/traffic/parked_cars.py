"""Cars that are parked at the kerb, half on the sidewalk. Some pull out in front of the ego.

They begin so late that the ego sees them when it can just stop, wait with their nose in the lane until it stands, and
then drive off as one of the traffic's. Who does not look for hazards runs into them: their centre is not in the lane
yet, so that they are nobody whom one could follow.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import Enum

import numpy as np
import shapely

from caldrive.datatypes import Pose, VehicleState
from caldrive.geometry import box_corners, boxes_overlap, moved, to_local, wrap_angle
from caldrive.world.roads.network import Lane, RoadNetwork
from caldrive.world.traffic.collisions import Obstacle
from caldrive.world.traffic.gap_acceptance import HARD_BRAKE, REACTION, SPARE

BESIDE = 2.3  # m to the right of the lane's middle
AFTER_START, BEFORE_END = 20.0, 45.0  # m of a lane where nobody parks: loops and signs of the lights are there
STRAIGHT, BEND = 12.0, 0.03  # m before and behind a place, and rad that the lane turns there at most
APART, CLEAR_OF_EGO = 25.0, 30.0  # m
ROOM = 0.3  # m to a post or tree
WILLING = 0.7  # share of those that pull out when the ego comes
WAY = 8.0  # m that pulling out takes along the lane
LINE = 1.8  # m of them after which the car is in the hazard area A2
NOSE_OUT = 2.7  # m of them after which it waits for the ego to stop
ACCELERATION, BRAKE = 2.0, 5.0  # m/s²
TO_LINE = math.sqrt(2 * LINE / ACCELERATION)  # s
SEEN = 7.2  # m from the ego's bumper to the car's middle within which it is in A2
SLOWEST, FASTEST = 2.5, 7.5  # m/s of an ego before which somebody pulls out
STANDS, AFTER = 0.3, 1.5  # m/s below which the ego stands, and s for which it has to before the car goes on
FARTHEST = 30.0  # m from the ego along an axis beyond which nobody who is parked begins
OTHERS = 14.0  # m around it within which no other car may drive
GONE = 5.0  # m that the ego is past its front when it may follow


class Stage(Enum):
    """What a car at the kerb does."""

    PARKED = "parked"
    PULLING_OUT = "pulling out"
    WAITING = "waiting"
    LEAVING = "leaving"


@dataclass
class ParkedCar:
    """One of them."""

    name: str
    length: float
    """m."""
    width: float
    """m."""
    lane: Lane
    s: float
    """m along the lane, where it is parked."""
    willing: bool
    """Whether it pulls out."""
    stage: Stage = Stage.PARKED
    way: float = 0.0
    """m along the lane since then."""
    speed: float = 0.0
    """m/s."""
    stood: float = 0.0
    """s for which the ego has stood before it."""

    @property
    def state(self) -> VehicleState:
        """As the world sees it."""
        share = min(self.way / WAY, 1.0)
        left = -BESIDE * (1 - share * share * (3 - 2 * share))
        turn = math.atan(BESIDE * 6 * share * (1 - share) / WAY)
        pose = moved(self.lane.line.pose_at(self.s + self.way), left=left, turn=turn)
        return VehicleState(pose, self.speed, length=self.length, width=self.width, id=self.name)

    @property
    def height(self) -> float:
        """Of the road, m."""
        return self.lane.height(self.s + self.way)


def room_to_stop(speed: float) -> float:
    """m that a driver needs who brakes at once."""
    return REACTION * speed + speed * speed / (2 * HARD_BRAKE) + SPARE


class ParkedCars:
    """All of a town's. near: what stands near a place, within so many m (`Town.obstacles`); models: name, length and
    width (m) of cars."""

    def __init__(
        self,
        roads: RoadNetwork,
        n: int,
        rng: np.random.Generator,
        *,
        ego: VehicleState,
        near: Callable[[Pose, float], list[Obstacle]],
        models: Sequence[tuple[str, float, float]],
    ) -> None:
        self.cars, self._awake = list[ParkedCar](), list[ParkedCar]()  # all, and those that move or stand out
        places = _places(roads) if n else []
        for k in rng.permutation(len(places)).tolist():
            lane, s = places[k]
            _, length, width = models[int(rng.integers(len(models)))]
            car = ParkedCar(f"parked{k}", length, width, lane, s, willing=bool(rng.random() < WILLING))
            if len(self.cars) < n and self._is_free(car, ego, near):
                self.cars.append(car)
        self._look()

    def _is_free(self, car: ParkedCar, ego: VehicleState, near: Callable[[Pose, float], list[Obstacle]]) -> bool:
        here = car.state.pose
        apart = [math.hypot(other.state.pose.x - here.x, other.state.pose.y - here.y) for other in self.cars]
        if min(apart, default=math.inf) < APART or math.hypot(ego.pose.x - here.x, ego.pose.y - here.y) < CLEAR_OF_EGO:
            return False
        box = box_corners(here, car.length + 2 * ROOM, car.width + 2 * ROOM)
        return not any(
            boxes_overlap(box, box_corners(thing.pose, thing.length, thing.width)) for thing in near(here, car.length)
        )

    def _look(self) -> None:
        """Takes down where they are, which changes only where one moves."""
        self._states = tuple(car.state for car in self.cars)
        self._places = np.array([(state.pose.x, state.pose.y) for state in self._states]).reshape(-1, 2)

    def states(self) -> tuple[VehicleState, ...]:
        """All that are still there."""
        return self._states

    def step(self, dt: float, ego: VehicleState, others: Sequence[VehicleState]) -> list[ParkedCar]:
        """Moves them on by dt seconds; returns those that have left and drive in their lane from now on. others: all
        that drive."""
        is_near = np.abs(self._places - (ego.pose.x, ego.pose.y)).max(axis=1, initial=0.0) <= FARTHEST
        moved_on = self._awake + [self.cars[k] for k in np.flatnonzero(is_near) if self.cars[k].stage is Stage.PARKED]
        for car in moved_on:
            _move(car, dt, ego, others)
        self._awake = [car for car in moved_on if car.stage is not Stage.PARKED]
        if not self._awake:
            return []
        gone = [car for car in self._awake if car.way >= WAY]
        self._awake = [car for car in self._awake if car.way < WAY]
        self.cars = [car for car in self.cars if car.way < WAY]
        self._look()
        return gone


def _places(roads: RoadNetwork) -> list[tuple[Lane, float]]:
    """Straight pieces of kerb: the lane beside, and m along it."""
    places = []
    for lane in roads.driveable:
        for s in np.arange(AFTER_START, lane.line.length - BEFORE_END, 4.0).tolist():
            bend = wrap_angle(lane.line.heading_at(s + STRAIGHT) - lane.line.heading_at(s - STRAIGHT))
            kerb = moved(lane.line.pose_at(s), left=-BESIDE - lane.width / 4)
            if abs(bend) < BEND and shapely.contains_xy(roads.sidewalk, kerb.x, kerb.y):
                places.append((lane, s))
    return places


def _move(car: ParkedCar, dt: float, ego: VehicleState, others: Sequence[VehicleState]) -> None:
    """A car's next dt seconds."""
    if car.stage is Stage.PARKED and not car.willing:
        return
    state = car.state
    ahead, left = to_local(moved(ego.pose, forward=ego.length / 2), np.array((state.pose.x, state.pose.y))).tolist()
    along = abs(wrap_angle(ego.pose.heading - car.lane.line.heading_at(car.s))) < 0.3
    if car.stage is Stage.PARKED:
        if along and abs(left) < 2 * BESIDE and _may_begin(ahead, ego.speed) and _is_alone(state, others):
            car.stage = Stage.PULLING_OUT
    elif car.stage is Stage.PULLING_OUT:
        late = car.way < LINE and ahead < room_to_stop(ego.speed) + 0.5 * car.length / 2
        if late or car.way >= NOSE_OUT:
            car.stage = Stage.WAITING
    elif car.stage is Stage.WAITING:
        car.stood = car.stood + dt if ego.speed < STANDS else 0.0
        if (car.stood > AFTER or ahead < -ego.length - GONE or ahead > 6 * SEEN) and _is_alone(state, others):
            car.stage = Stage.LEAVING
    _drive(car, dt)


def _drive(car: ParkedCar, dt: float) -> None:
    """Speeds up, or stops with its nose out."""
    if car.stage is Stage.PARKED:
        return
    stops = car.stage is Stage.WAITING or (
        car.stage is Stage.PULLING_OUT and car.way + car.speed**2 / (2 * BRAKE) >= NOSE_OUT
    )
    car.speed = max(0.0, car.speed + (-BRAKE if stops else ACCELERATION) * dt)
    car.way += car.speed * dt


def _may_begin(ahead: float, speed: float) -> bool:
    """Whether an ego so many m before the car's middle at a speed sees it in time, and no earlier than it must."""
    if not SLOWEST < speed < FASTEST:
        return False
    then = ahead - speed * TO_LINE
    return room_to_stop(speed) + 1.0 <= then <= max(SEEN, room_to_stop(speed) + 2.0)


def _is_alone(car: VehicleState, others: Sequence[VehicleState]) -> bool:
    x, y = car.pose.x, car.pose.y
    return not any(
        abs(other.pose.x - x) < OTHERS and abs(other.pose.y - y) < OTHERS and other.id != car.id
        and math.cos(other.pose.heading - car.pose.heading) > 0.5
        for other in others
    )  # fmt: skip
