"""Ground as the planner sees it, drawn from above: roads as rectangles, things that move as discs."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from caldrive.agents.modular_pipeline.ground import SHAPE, GroundGrid, cell_middles
from caldrive.agents.modular_pipeline.scene import SceneClass

Box = tuple[float, float, float, float]  # x from, x to, y from, y to; m


def ground(roads: Sequence[Box], moving: Sequence[Box] = (), seen: Box | None = None) -> GroundGrid:
    """Roads among sidewalks, with things that move on them. seen: what the cameras see; without it all."""
    x, y = cell_middles().T

    def inside(box: Box) -> np.ndarray:
        return (x > box[0]) & (x < box[1]) & (y > box[2]) & (y < box[3])

    kinds = np.full(len(x), SceneClass.SIDEWALK)
    for box in roads:
        kinds[inside(box)] = SceneClass.ROAD
    for box in moving:
        kinds[inside(box)] = SceneClass.DYNAMIC
    is_seen = np.ones(len(x), bool) if seen is None else inside(seen)
    classes = np.eye(len(SceneClass), dtype=np.float32)[kinds] * is_seen[:, None]
    return GroundGrid(classes.reshape(*SHAPE, -1), is_seen.reshape(SHAPE))


STREET: Box = (-1.0, 30.0, -2.0, 6.0)  # of two lanes, the car in the middle of the right one
