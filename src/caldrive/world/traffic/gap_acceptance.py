"""When people step in front of cars: they accept a gap in which a driver who keeps to the limit can still stop for
them, or has passed, or is slow; in front of a fast car they wait."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from caldrive.compiled import compiled, inlined
from caldrive.datatypes import Points

CORRIDOR = 2.05  # m to either side of a car's middle
STOPPABLE_SPEED = 9.2  # m/s: from it a full brake stops within the hazard area A2
SEEN_FROM = 8.0  # m ahead of a car's front within which it may begin to brake for them
MAY_GAIN = 3.0  # m/s² by which a moving car may speed up
MOVING = 0.3  # m/s from which on a car moves
STANDING_GAP = 0.8  # m ahead of a standing car within which nobody walks
STANDS_STILL = 1e-6  # m across a corridor: who goes no farther enters none
PASSED = 1.0  # m behind a car's rear from which on it has passed
Floats = NDArray[np.float64]


@compiled
def may_walk(position: Points, way: tuple[float, float], pace: float, boxes: Floats) -> bool:
    """Whether somebody (2,) may walk a stretch (x, y in m) at a pace (m/s): who enters no corridor of a car that by
    then is beside them or can neither stop nor pass. boxes: see `geometry.boxes_of`."""
    for car in range(len(boxes)):
        heading, speed, half = boxes[car, 2], boxes[car, 3], boxes[car, 4]
        dx, dy, u, v = position[0] - boxes[car, 0], position[1] - boxes[car, 1], math.cos(heading), math.sin(heading)
        ahead, left = dx * u + dy * v - half, dy * u - dx * v
        sideways = way[1] * u - way[0] * v  # how far the stretch goes across the car's corridor
        if abs(sideways) <= STANDS_STILL or left * sideways >= 0:
            continue
        share = (abs(left) - CORRIDOR) / abs(sideways)
        if 0 < share <= 1:
            arrives = share * math.hypot(way[0], way[1]) / pace
            then = ahead + share * (way[0] * u + way[1] * v) - speed * arrives
            if then > -2 * half - PASSED and _cannot_stop(then, arrives, speed, 2 * CORRIDOR / pace):
                return False
    return True


@inlined
def _cannot_stop(then: float, arrives: float, speed: float, taken: float) -> bool:
    """Whether a car cannot stop for somebody who enters its corridor after `arrives` s, `then` m ahead of its front if
    it goes on at its speed (m/s), and who leaves it `taken` s later."""
    is_moving = speed > MOVING
    gained = (MAY_GAIN if is_moving else 0.0) * arrives  # they reckon with a car that speeds up
    nearest, fastest = then - gained * arrives / 2, speed + gained
    room = fastest * 4.5 if fastest > STOPPABLE_SPEED else 3.5 + fastest * 0.5 + fastest * fastest / 10
    # Until it sees them a car may speed up further: is it too fast by then, and there before they have left?
    unseen = max(nearest - SEEN_FROM, 0.0)
    too_fast = fastest * fastest + 2 * MAY_GAIN * unseen > STOPPABLE_SPEED * STOPPABLE_SPEED
    surprised = is_moving and too_fast and unseen < fastest * taken + MAY_GAIN * taken * taken / 2
    too_near = nearest < (room if is_moving else STANDING_GAP)
    return bool(too_near or surprised)
