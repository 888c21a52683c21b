"""When people step in front of cars. The careful accept a gap in which a driver who keeps to the limit can still stop
for them, or has passed, or is slow; in front of a fast car they wait. The bold misjudge the ego: they step out in front
of it as soon as a driver who brakes at once can just stop. So who looks can always avoid them, and who does not cannot.
Before an ego that turns nobody is bold, and in a tight turn, where it looks past its path, nobody enters that as long
as it could be there before they have left.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from caldrive.compiled import compiled, inlined
from caldrive.datatypes import Points

CORRIDOR = 2.05  # m to either side of a car's middle
STOPPABLE_SPEED = 9.2  # m/s: from it a full brake stops within the hazard area A2
SEEN_FROM, SEEN_ASIDE = 8.0, 1.9  # m ahead of a car's front and aside within which it may begin to brake for them
MAY_GAIN = 3.0  # m/s² by which a moving car may speed up
MOVING = 0.3  # m/s from which on a car moves
STANDING_GAP = 0.8  # m ahead of a standing car within which nobody walks
STANDS_STILL = 1e-6  # m across a corridor: who goes no farther enters none
PASSED = 1.0  # m behind a car's rear from which on it has passed
# Of a driver who brakes at once: s until the brake works, m/s², and m that remain between him and somebody.
REACTION, HARD_BRAKE, SPARE = 0.3, 6.5, 0.8
EGO = 0  # its row among the boxes
BODY, TOUCH = 1.35, 0.45  # m: half of a car and of a person beside it, and from its ends, with some room
FULL_BRAKE, LEFT_OVER = 7.0, 0.3  # m/s² of a driver who brakes already, and m that remain
STEP = 0.35  # m that somebody who runs gets on in a step
DRIFT = 0.3  # m by which who stands beside a car's path may come to lie in it, as that changes
REAR = 0.6  # halves of a car's length from its middle back to its rear axle
STRAIGHT = 0.02  # 1/m: less curved paths are as good as straight
CROSSES = 2.0  # s that somebody takes to leave the way of a car
TIGHT = 0.05  # 1/m: on a path that curves so much a driver who looks straight ahead sees nobody early enough
STEPS_OVER = 0.4  # m from one look along a way to the next
MEMORY, FORESIGHT = 0.5, 1.0  # s over which people average the bend of the ego's path, and s that they look ahead
SHARPEST = 0.27  # 1/m: the ego's wheels turned as far as they go
Floats = NDArray[np.float64]


class Cars(NamedTuple):
    """Whom people look out for."""

    boxes: Floats
    """(M, 5), see `geometry.boxes_of`; the ego first."""
    curvature: float = 0.0
    """1/m of the ego's path as its wheels stand, + to the left."""
    soon: float = 0.0
    """Likewise as they will stand in a moment."""


def watched(lately: float, curvature: float, dt: float) -> float:
    """The curvature (1/m) that the ego's path has had lately, dt seconds later."""
    return lately + (curvature - lately) * min(dt / MEMORY, 1.0)


def foreseen(lately: float, curvature: float) -> tuple[float, float]:
    """The curvature (1/m) of the ego's path, and that which people expect in a moment if its wheels go on turning so;
    who turns them back is expected to drive straight on."""
    soon = curvature + (curvature - lately) * FORESIGHT / MEMORY
    turns_back = soon * lately < 0 and abs(curvature) <= abs(lately)
    return curvature, 0.0 if turns_back else min(max(soon, -SHARPEST), SHARPEST)


@compiled
def may_walk(position: Points, way: tuple[float, float], pace: float, cars: Cars, is_bold: bool) -> bool:
    """Whether somebody (2,) may walk a stretch (x, y in m) at a pace (m/s): who enters no corridor of a car that by
    then is beside them or can neither stop nor pass. is_bold: in front of the ego, unless it turns."""
    for look in range(_looks(cars)):
        car, curvature = _looked_at(cars, look)
        straight = STRAIGHT if look == car else TIGHT  # a driver whose steering is unsteady is not about to turn
        is_bold_now = is_bold and car == EGO and abs(curvature) < straight
        if _is_too_near(position, way, pace, cars.boxes[car], curvature, is_bold_now):
            return False
    return True


@compiled
def bumps(position: Points, step: tuple[float, float], cars: Cars) -> bool:
    """Whether a step (x, y in m) leads somebody (2,) into a car, or in front of one that would reach them even if it
    braked fully, or in a tight turn if it did not: a car that turns may come to be before people who have entered no
    corridor, and beside them."""
    for look in range(_looks(cars)):
        car, curvature = _looked_at(cars, look)
        box = cars.boxes[car]
        if _leaves(position, step, box):
            continue
        if _is_bumped(position, step, box, curvature, _reach(position, box, curvature)):
            return True
        if curvature != 0 and _is_bumped(position, step, box, 0.0, TOUCH):  # its body does not bend with its path
            return True
    return False


@compiled
def is_clear(position: Points, end: Points, cars: Cars) -> bool:
    """Whether no car stands in the way of somebody who crosses from one place (2,) to another."""
    length = math.hypot(end[0] - position[0], end[1] - position[1])
    n = int(length / STEPS_OVER) + 1
    for car in range(len(cars.boxes)):
        if car == EGO or cars.boxes[car, 3] > MOVING:
            continue
        for k in range(n + 1):
            x, y = position[0] + (end[0] - position[0]) * k / n, position[1] + (end[1] - position[1]) * k / n
            ahead, left = _before(cars.boxes[car], x, y, 0.0)
            if -2 * cars.boxes[car, 4] - 2 * TOUCH < ahead < 2 * TOUCH and abs(left) < BODY:
                return False
    return True


@inlined
def _looks(cars: Cars) -> int:
    """How often somebody looks: at each car, and at the ego once more if its path changes."""
    return len(cars.boxes) + int(len(cars.boxes) > 0 and cars.soon != cars.curvature)


@inlined
def _looked_at(cars: Cars, look: int) -> tuple[int, float]:
    """Which car somebody looks at, and the curvature of its path, 1/m."""
    if look == len(cars.boxes):
        return EGO, cars.soon
    return look, cars.curvature if look == EGO else 0.0


@inlined
def _is_too_near(
    position: Points, way: tuple[float, float], pace: float, box: Floats, curvature: float, is_bold: bool
) -> bool:
    """Whether a stretch leads into the corridor of a car on such a path that can neither stop nor pass. is_bold: who
    trusts that it brakes at once."""
    speed, half = box[3], box[4]
    ahead, left = _before(box, position[0], position[1], curvature)
    farther, then_left = _before(box, position[0] + way[0], position[1] + way[1], curvature)
    sideways = then_left - left  # how far the stretch goes across the car's corridor
    if abs(sideways) <= STANDS_STILL or left * sideways >= 0:
        return False
    share = (abs(left) - CORRIDOR) / abs(sideways)
    if not 0 < share <= 1:
        return False
    arrives, taken = share * math.hypot(way[0], way[1]) / pace, 2 * CORRIDOR / pace
    then = ahead + share * (farther - ahead) - speed * arrives
    if then <= -2 * half - PASSED:
        return False
    if is_bold:
        return _cannot_stop_at_once(then, speed, taken)
    is_there_first = then < speed * taken + MAY_GAIN * taken * taken / 2
    return bool((is_there_first and _is_unseen(position, box, curvature)) or _cannot_stop(then, arrives, speed, taken))


@inlined
def _reach(position: Points, box: Floats, curvature: float) -> float:
    """m ahead of a car on such a path within which it cannot stop any more, or does not see somebody in time."""
    speed = box[3]
    if speed > MOVING and _is_unseen(position, box, curvature):
        return float(speed * CROSSES + MAY_GAIN * CROSSES * CROSSES / 2)
    if speed > MOVING:
        return float(max(TOUCH, speed * REACTION / 2 + speed * speed / (2 * FULL_BRAKE) + LEFT_OVER))
    return TOUCH


@inlined
def _is_bumped(position: Points, step: tuple[float, float], box: Floats, curvature: float, reach: float) -> bool:
    """Whether a step leads into a car on such a path, or in front of it within its reach (m)."""
    half = box[4]
    ahead, left = _before(box, position[0], position[1], curvature)
    then_ahead, then_left = _before(box, position[0] + step[0], position[1] + step[1], curvature)
    body = _body(left, half, curvature)
    is_near = -2 * half - TOUCH < ahead < reach and abs(left) < body
    will_be = -2 * half - TOUCH < then_ahead < reach and abs(then_left) < _body(then_left, half, curvature)
    # Who is before a car goes on, so as to leave; but nobody comes nearer to one that is beside them, or nearly past.
    may_stay = ahead < TOUCH or abs(left) > body - DRIFT
    return bool(will_be and (not is_near or (may_stay and abs(then_left) < abs(left))))


@inlined
def _leaves(position: Points, step: tuple[float, float], box: Floats) -> bool:
    """Whether a step leads somebody who is before a standing car rather aside than nearer: they must not stay there
    because it brings them a little nearer, as that car would stay, too."""
    ahead, left = _before(box, position[0], position[1], 0.0)
    then_ahead, then_left = _before(box, position[0] + step[0], position[1] + step[1], 0.0)
    is_before = -2 * box[4] - TOUCH < ahead < TOUCH + STEP and abs(left) < BODY
    return bool(box[3] <= MOVING and is_before and abs(then_left) - abs(left) > abs(then_ahead - ahead))


@inlined
def _is_unseen(position: Points, box: Floats, curvature: float) -> bool:
    """Whether somebody is in no place where the driver of a car in a tight turn looks, straight ahead."""
    ahead, left = _before(box, position[0], position[1], 0.0)
    return bool(abs(curvature) >= TIGHT and not (0 < ahead < SEEN_FROM and abs(left) < SEEN_ASIDE))


@inlined
def _before(box: Floats, x: float, y: float, curvature: float) -> tuple[float, float]:
    """How far a place lies ahead of a car's front and left of its middle, m; along its path where that is curved."""
    u, v = math.cos(box[2]), math.sin(box[2])
    dx, dy = x - box[0], y - box[1]
    ahead, left, rear = dx * u + dy * v, dy * u - dx * v, REAR * box[4]
    if ahead > -rear and abs(curvature) >= STRAIGHT:  # it turns around a point beside its rear axle
        side, radius = math.copysign(1.0, curvature), 1 / abs(curvature)
        to_center = radius - side * left
        along = radius * math.atan2(ahead + rear, to_center) - rear
        return along - box[4], side * (radius - math.hypot(ahead + rear, to_center))
    return ahead - box[4], left


@inlined
def _body(left: float, half: float, curvature: float) -> float:
    """m from the path of a car within which it touches somebody left of it: its front swings out of a turn."""
    front = (1 + REAR) * half
    return BODY + front * front * abs(curvature) / 2 if left * curvature < 0 else BODY


@inlined
def _cannot_stop(then: float, arrives: float, speed: float, taken: float) -> bool:
    """Whether a car cannot stop for somebody who enters its corridor after `arrives` s, `then` m ahead of its front if
    it goes on at its speed (m/s), and who leaves it `taken` s later."""
    is_moving = speed > MOVING
    gained = (MAY_GAIN if is_moving else 0.0) * arrives  # they reckon with a car that speeds up
    nearest, fastest = then - gained * arrives / 2, speed + gained
    room = fastest * 4.5 if fastest > STOPPABLE_SPEED else 3.5 + fastest * 0.5 + fastest * fastest / 10
    too_near = nearest < (room if is_moving else STANDING_GAP)
    return bool(too_near or _is_surprised(nearest, fastest, taken))


@inlined
def _cannot_stop_at_once(ahead: float, speed: float, taken: float) -> bool:
    """Likewise a car whose driver brakes as soon as they enter its corridor, so many m ahead of its front."""
    room = REACTION * speed + speed * speed / (2 * HARD_BRAKE) + SPARE
    return bool(ahead < (room if speed > MOVING else STANDING_GAP) or _is_surprised(ahead, speed, taken))


@inlined
def _is_surprised(ahead: float, speed: float, taken: float) -> bool:
    """Whether a car that speeds up until it sees them is too fast by then, and there before they have left."""
    unseen = max(ahead - SEEN_FROM, 0.0)
    too_fast = speed * speed + 2 * MAY_GAIN * unseen > STOPPABLE_SPEED * STOPPABLE_SPEED
    return speed > MOVING and too_fast and unseen < speed * taken + MAY_GAIN * taken * taken / 2
