"""Cars that are parked at the kerb, half on the sidewalk. Some pull out in front of the ego.

They begin so late that the ego sees them when it can just stop, wait with their nose in the lane until it stands, and
then drive off as one of the traffic's. Who does not look for hazards runs into them: their centre is not in the lane
yet, so that they are nobody whom one could follow. Where the ego could not stop after all, as it speeds up, they stay
beside its path; from a point on they do not go back any more, as half out they would be hit before they are seen.
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
CLEAR = 0.55  # m of them up to which an ego in the middle of its lane passes by
ACCELERATION, BRAKE = 2.0, 5.0  # m/s²
TO_LINE = math.sqrt(2 * LINE / ACCELERATION)  # s
SEEN = 7.2  # m from the ego's bumper to the car's middle within which it is in A2
SLOWEST, FASTEST = 2.5, 7.0  # m/s of an ego before which somebody pulls out: who is faster cannot stop within SEEN
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
        self._speed = ego.speed  # the ego's, of the step before
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
        acceleration, self._speed = (ego.speed - self._speed) / dt, ego.speed
        for car in moved_on:
            _move(car, dt, ego, acceleration, others)
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


def _move(
    car: ParkedCar, dt: float, ego: VehicleState, acceleration: float, others: Sequence[VehicleState]
) -> None:  # fmt: skip
    """A car's next dt seconds. acceleration: of the ego, m/s²."""
    if car.stage is Stage.PARKED and not car.willing:
        return
    state = car.state
    ahead, left = to_local(moved(ego.pose, forward=ego.length / 2), np.array((state.pose.x, state.pose.y))).tolist()
    along = abs(wrap_angle(ego.pose.heading - car.lane.line.heading_at(car.s))) < 0.3
    if car.stage is Stage.PARKED:
        is_here = along and abs(left) < 2 * BESIDE
        if is_here and _may_begin(*_then(ahead, ego.speed, acceleration, TO_LINE)) and _is_alone(state, others):
            car.stage = Stage.PULLING_OUT
    elif car.stage is Stage.PULLING_OUT:
        if car.way >= NOSE_OUT or (_can_stay(car, dt) and not _can_stop(car, ahead, ego.speed, acceleration)):
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


def _then(ahead: float, speed: float, acceleration: float, after: float) -> tuple[float, float]:
    """m to the car's middle, and speed, of an ego that goes on as it does for so many s."""
    later = max(0.0, speed + acceleration * after)
    return ahead - (speed + later) / 2 * after, later


def _may_begin(ahead: float, speed: float) -> bool:
    """Whether an ego so many m before the car's middle at a speed, when the car is seen, can stop and has to."""
    if not SLOWEST < speed < FASTEST:
        return False
    return room_to_stop(speed) + 1.0 <= ahead <= max(SEEN, room_to_stop(speed) + 2.0)


def _can_stay(car: ParkedCar, dt: float) -> bool:
    """Whether a car still stays beside the path of an ego if it begins to brake after dt seconds."""
    return car.way + car.speed * dt + car.speed**2 / (2 * BRAKE) <= CLEAR


def _can_stop(car: ParkedCar, ahead: float, speed: float, acceleration: float) -> bool:
    """Whether an ego that goes on as it does can stop from when the car is seen."""
    to_line = (math.sqrt(car.speed**2 + 2 * ACCELERATION * (LINE - car.way)) - car.speed) / ACCELERATION
    then, later = _then(ahead, speed, acceleration, to_line)
    return later < FASTEST and then >= room_to_stop(later)


def _is_alone(car: VehicleState, others: Sequence[VehicleState]) -> bool:
    x, y = car.pose.x, car.pose.y
    return not any(
        abs(other.pose.x - x) < OTHERS and abs(other.pose.y - y) < OTHERS and other.id != car.id
        and math.cos(other.pose.heading - car.pose.heading) > 0.5
        for other in others
    )  # fmt: skip
