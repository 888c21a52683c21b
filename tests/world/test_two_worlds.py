"""Two worlds in one process: they do not disturb each other, or the second one is refused in a sentence."""

from __future__ import annotations

import gc
from contextlib import closing

import numpy as np
import pytest

from caldrive.datatypes import CameraConfig, Control, Image, Truth
from caldrive.scenarios import Scenario
from caldrive.world.embedded import EmbeddedWorld
from caldrive.world.roads.towns import load_roads

pytestmark = pytest.mark.usefixtures("no_sumo_left")

CAMERA = CameraConfig(width=100, height=44)
FORWARD = Control(throttle=0.5)


def straight_on(town: str, cars: int = 0, weather: int = 1) -> Scenario:
    """Along the longest lane of a town, among some people."""
    lane = max(load_roads(town).driveable, key=lambda lane: lane.line.length).line
    start, goal = lane.pose_at(5.0), lane.pose_at(lane.length - 5.0)
    return Scenario(town, weather=weather, start=start, goal=goal, n_vehicles=cars, n_pedestrians=30, seed=2)


def drivers(truth: Truth) -> int:
    """How many cars drive; others are parked."""
    return sum(not car.id.startswith("parked") for car in truth.vehicles)


def drive_alone(scenario: Scenario, steps: int) -> list[tuple[Truth, Image]]:
    """What is true and what is seen after each step in a world that has the process for itself."""
    with closing(EmbeddedWorld(CAMERA)) as world:
        world.reset(scenario)
        return [(world.truth(), image) for image in (world.step(FORWARD).image for _ in range(steps))]


def test_without_traffic_two_worlds_drive_in_turns_as_each_would_alone() -> None:
    scenarios = [straight_on("town01"), straight_on("town02", weather=13)]
    alone = [drive_alone(scenario, steps=5) for scenario in scenarios]
    with closing(EmbeddedWorld(CAMERA)) as first, closing(EmbeddedWorld(CAMERA)) as second:
        worlds = (first, second)
        for world, scenario in zip(worlds, scenarios, strict=True):
            world.reset(scenario)
        for k in range(5):
            for world, kept in zip(worlds, alone, strict=True):
                image = world.step(FORWARD).image
                assert world.truth() == kept[k][0]
                assert np.array_equal(image, kept[k][1])


def test_each_world_shows_its_own_town_whoever_was_drawn_before() -> None:
    mounts = [CAMERA, CameraConfig(width=64, height=48, yaw=0.3)]
    with closing(EmbeddedWorld()) as first, closing(EmbeddedWorld()) as second:
        first.reset(straight_on("town01", weather=6))
        second.reset(straight_on("town02", weather=6), appearance=3)
        kept = [(world.images(mounts), world.semantic_images(mounts)) for world in (first, second)]
        assert not np.array_equal(kept[0][0][0], kept[1][0][0])
        for world, (images, classes) in ((first, kept[0]), (second, kept[1]), (first, kept[0])):
            assert all(map(np.array_equal, world.semantic_images(mounts), classes))
            assert all(map(np.array_equal, world.images(mounts), images))
        second.close()
        assert all(map(np.array_equal, first.images(mounts), kept[0][0]))


def test_with_traffic_a_second_world_is_refused_until_the_first_is_closed() -> None:
    scenario = straight_on("town02", cars=5)
    with closing(EmbeddedWorld()) as first, closing(EmbeddedWorld()) as second:
        first.reset(scenario)
        with pytest.raises(RuntimeError, match=r"found another world with traffic in this process.*: close\(\) that"):
            second.reset(scenario)
        first.step(FORWARD)
        assert drivers(first.truth()) == 5
        first.close()
        second.reset(scenario)
        second.step(FORWARD)
        assert drivers(second.truth()) == 5


def test_beside_a_world_with_traffic_one_without_drives() -> None:
    with closing(EmbeddedWorld()) as first, closing(EmbeddedWorld()) as second:
        first.reset(straight_on("town02", cars=5))
        second.reset(straight_on("town01"))
        second.step(FORWARD)
        second.close()
        first.step(FORWARD)
        assert drivers(first.truth()) == 5


def test_an_episode_that_lost_sumo_says_so_and_its_end_ends_no_other() -> None:
    scenario = straight_on("town02", cars=5)
    with closing(EmbeddedWorld()) as first, closing(EmbeddedWorld()) as second:
        first.reset(scenario)
        with pytest.raises(ValueError, match="cars asked for"):
            first.reset(straight_on("town02", cars=5000))
        second.reset(scenario)
        with pytest.raises(RuntimeError, match=r"found an episode that has lost SUMO.*: call reset\(scenario\)"):
            first.step(FORWARD)
        first.close()
        second.step(FORWARD)
        assert drivers(second.truth()) == 5


@pytest.mark.parametrize("in_a_cycle", [False, True], ids=["at once", "by the garbage collector"])
def test_a_world_that_nobody_holds_any_more_does_not_block_a_new_one(in_a_cycle: bool) -> None:
    scenario = straight_on("town02", cars=5)
    gc.disable()  # only what the world itself does counts
    try:
        dropped = EmbeddedWorld()
        dropped.reset(scenario)
        if in_a_cycle:
            dropped.itself = dropped  # type: ignore[attr-defined]
        del dropped
        with closing(EmbeddedWorld()) as world:
            world.reset(scenario)
            world.step(FORWARD)
            assert drivers(world.truth()) == 5
    finally:
        gc.enable()
