"""Hazard stop: the summed probability of what moves, in the corridor that the car is about to drive through (S.2.1)."""

from __future__ import annotations

import numpy as np

from caldrive.agents.modular_pipeline.ground import GroundGrid
from caldrive.agents.modular_pipeline.scene import SceneClass
from caldrive.datatypes import Points

HALF_WIDTH = 1.1  # m, of the corridor; the car is 1.8 m wide
BUMPER = 2.1  # m ahead of the car's centre
DECELERATION, REACTION, MARGIN = 4.0, 0.5, 6.5  # m/s², s, and m that are left in front of the bumper
STEP = 0.25  # m between two places of the corridor
ACROSS = np.arange(-HALF_WIDTH + STEP / 2, HALF_WIDTH, STEP)
UNSURE = 0.3  # probability below which a place does not count: little by little a whole street would add up
THRESHOLD = 0.4  # m² of things that move


def stopping_distance(speed: float) -> float:
    """m from the bumper to where a car comes to stand, v² / 2a + v t, and a margin; speed in m/s."""
    return speed * speed / (2 * DECELERATION) + speed * REACTION + MARGIN


def corridor(waypoints: Points, length: float) -> Points:
    """Places (N, M, 2) across the way along waypoints (K, 2), from the car's centre on up to so many m along it."""
    line = np.concatenate(([(0.0, 0.0)], waypoints[waypoints[:, 0] > 0.0]))
    s = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(line, axis=0).T))))
    at = np.arange(0.0, min(length, s[-1]), STEP)
    x, y = (np.interp(at, s, line[:, k]) for k in (0, 1))
    if len(at) < 2:
        return np.zeros((0, len(ACROSS), 2))
    heading = np.arctan2(np.gradient(y), np.gradient(x))
    return np.stack(
        (x[:, None] - ACROSS * np.sin(heading)[:, None], y[:, None] + ACROSS * np.cos(heading)[:, None]), axis=-1
    )


def moving_area(grid: GroundGrid, waypoints: Points, speed: float) -> float:
    """m² of the corridor up to the stopping distance that cars and people take up, each place by its probability."""
    classes, _ = grid.at(corridor(waypoints, BUMPER + stopping_distance(speed)))
    moving = classes[..., SceneClass.DYNAMIC]
    return float(moving[moving > UNSURE].sum()) * STEP * STEP
