"""What can be seen of a town from where."""

from __future__ import annotations

import tracemalloc

import numpy as np

from caldrive.datatypes import Pose
from caldrive.world.rendering.occlusion import CELL, OcclusionMap
from caldrive.world.scene.scenery import Prop

WALL = Prop("building", Pose(40.0, 4.0, 0.0), length=8.0, width=80.0, height=9.0)
FAR_AWAY = Prop("building", Pose(-30_000.0, 30_000.0, 0.0), length=8.0, width=8.0, height=9.0)
LOW, HIGH = np.array([0.0, 0.0]), np.array([8.0, 8.0])


def seen(occlusion: OcclusionMap) -> set[tuple[int, int]]:
    return set(map(tuple, occlusion.visible_cells(LOW, HIGH, far=120.0).tolist()))


def test_a_house_is_seen_and_what_lies_behind_it_is_not() -> None:
    cells = seen(OcclusionMap([WALL]))
    assert (int(36 // CELL), 0) in cells
    assert (int(90 // CELL), 0) not in cells
    assert (int(-90 // CELL), 0) in cells


def test_what_is_seen_does_not_depend_on_where_somebody_looked_before() -> None:
    """The map of a block is kept: another block has another one."""
    rng = np.random.default_rng(0)
    places = rng.uniform((-600, -600, 0), (600, 600, 3), (300, 3)).tolist()
    houses = [Prop("building", Pose(x, y, turned), 12.0, 9.0, 9.0) for x, y, turned in places]
    kept = OcclusionMap(houses)
    for x in np.arange(-400.0, 400.0, 56.0):
        low = np.array([x, x / 2])
        fresh = OcclusionMap(houses).visible_cells(low, low + 8.0, far=120.0)
        np.testing.assert_array_equal(kept.visible_cells(low, low + 8.0, far=120.0), fresh)


def test_a_house_far_away_changes_nothing_and_costs_nothing() -> None:
    tracemalloc.start()
    near, both = seen(OcclusionMap([WALL])), seen(OcclusionMap([WALL, FAR_AWAY]))
    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert near == both
    assert most < 20e6, "bytes"
