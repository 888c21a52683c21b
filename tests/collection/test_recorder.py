"""One recorded episode: three cameras with labels of their own, and where and among whom it is driven."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from caldrive.agents.cal import CALAgent, OraclePerception
from caldrive.collection.config import CollectConfig
from caldrive.collection.oracles import HiddenCarsOracle, TailgatingOracle
from caldrive.collection.recorder import BASELINES, record_episode
from caldrive.collection.start_poses import EpisodePlan, begin_episode, plan_episode
from caldrive.control.controller import CALController
from caldrive.datatypes import CameraConfig, Semantic
from caldrive.recordings.reader import Episode, read_episode
from caldrive.recordings.writer import EpisodeError, episode_path
from caldrive.world.embedded import EmbeddedWorld

TINY = CollectConfig("town02", (1, 6), duration=2.0, cars=6, people=10, tailgating=0.0, width=48, height=24, seed=4)


@pytest.fixture(scope="module")
def world() -> Iterator[EmbeddedWorld]:
    world = EmbeddedWorld()
    yield world
    world.close()


@pytest.fixture(scope="module")
def recorded(world: EmbeddedWorld, tmp_path_factory: pytest.TempPathFactory) -> list[Episode]:
    folder = tmp_path_factory.mktemp("recorded")
    return [recording(world, TINY, folder, number) for number in range(3)]


@pytest.fixture
def episode(recorded: list[Episode]) -> Episode:
    return recorded[0]


def recording(
    world: EmbeddedWorld, config: CollectConfig, folder: Path, number: int = 0, semantic: bool = False
) -> Episode:
    record_episode(world, config, number, folder)
    return read_episode(episode_path(folder, number), semantic=semantic)


def begun(world: EmbeddedWorld, config: CollectConfig) -> tuple[EpisodePlan, CALAgent]:
    """An episode's plan and driver."""
    rng = np.random.default_rng(1)
    plan = plan_episode(config, 0, rng)
    return plan, begin_episode(world, config, plan, rng)[1]


def test_every_moment_is_seen_by_three_cameras_at_their_baselines(episode: Episode) -> None:
    assert len(episode) == 3 * 20
    frames = list(episode)
    assert {(frame.camera, frame.camera_left) for frame in frames} == set(enumerate(BASELINES))
    assert {frame.image.shape for frame in frames} == {(24, 48, 3)}
    left, middle, right = ([frame.index for frame in frames if frame.camera == camera] for camera in range(3))
    assert left == middle == right == sorted(set(middle))


def test_a_camera_keeps_its_yaw_which_is_15_degrees_at_most(recorded: list[Episode]) -> None:
    yaws = set()
    for columns in (episode.columns for episode in recorded):
        for camera in range(3):
            (yaw,) = set(columns["camera_yaw"][columns["camera"] == camera])
            yaws.add(float(yaw))
    assert len(yaws) == 9
    assert max(map(abs, yaws)) <= math.radians(15)


def test_each_camera_has_the_labels_of_its_own_place(episode: Episode) -> None:
    for i in range(20):
        left, middle, right = (episode[camera * 20 + i] for camera in (2, 1, 0))
        assert left.time == middle.time == right.time
        assert left.driven == middle.driven == right.driven
        a, b = left.affordances, right.affordances
        straight = abs(a.relative_angle + left.camera_yaw) < 0.02
        if straight:
            swing = (1.3 - CameraConfig().forward) * (math.sin(left.camera_yaw) - math.sin(right.camera_yaw))
            assert b.center_distance - a.center_distance == pytest.approx(1.0 + swing, abs=0.05)
        turned = a.relative_angle - b.relative_angle
        assert turned == pytest.approx(right.camera_yaw - left.camera_yaw, abs=0.15)


def test_frames_inside_a_junction_are_marked(world: EmbeddedWorld, tmp_path: Path) -> None:
    before_turns = replace(TINY, duration=9.0, cars=0, people=0, before_signs=0.0, before_turns=1.0, seed=3)
    episode = recording(world, before_turns, tmp_path)
    inside = episode.columns["junction"]
    assert 0.05 < inside.mean() < 0.95
    others = [frame for frame in episode if frame.other is not None]
    assert 0.05 < len(others) / len(episode) < 0.95
    assert all(frame.other and frame.other.command is not frame.command for frame in others)
    apart = [abs(frame.other.center_distance - frame.affordances.center_distance) for frame in others if frame.other]
    assert min(apart) < 0.02  # the ways are one before the junction,
    assert max(apart) > 1.0  # and part inside


def test_the_cameras_see_different_pictures_that_change(episode: Episode) -> None:
    assert len(set(episode.jpegs)) > 50


def test_weathers_take_turns(recorded: list[Episode]) -> None:
    assert [episode.scenario.weather for episode in recorded] == [1, 6, 1]


def test_episodes_differ_in_start_and_seed(recorded: list[Episode]) -> None:
    scenarios = [episode.scenario for episode in recorded]
    assert len({scenario.seed for scenario in scenarios}) == len({scenario.start for scenario in scenarios}) == 3


def test_semantic_images_are_recorded_where_they_are_asked_for(
    world: EmbeddedWorld, episode: Episode, tmp_path: Path
) -> None:
    with_semantics = recording(world, replace(TINY, semantic=True), tmp_path, semantic=True)
    assert with_semantics.semantic(5).shape == with_semantics.image(5).shape[:2]
    assert Semantic.ROAD in with_semantics.semantic(5)
    assert with_semantics.jpegs == episode.jpegs
    assert read_episode(episode_path(tmp_path, 0)).semantics is None
    with pytest.raises(EpisodeError, match="record with --semantic"):
        episode.semantic(5)


def test_a_tailgater_drives_among_twice_the_cars_and_is_told_something_else(world: EmbeddedWorld) -> None:
    config = replace(TINY, before_signs=1.0, tailgating=1.0)
    plan, agent = begun(world, config)
    assert plan.scenario.n_vehicles == 2 * config.cars
    assert isinstance(agent.perception, TailgatingOracle)
    assert isinstance(agent.controller, CALController)
    assert agent.controller.config.cap == 20.0
    assert begun(world, replace(config, tailgating=0.0))[0].scenario.n_vehicles <= config.cars


def test_some_episodes_begin_beside_their_lane_and_come_back(world: EmbeddedWorld, tmp_path: Path) -> None:
    aside = replace(TINY, duration=9.0, cars=0, people=0, displaced=1.0, before_turns=0.0)
    columns = recording(world, aside, tmp_path).columns
    center = np.abs(columns["center_distance"][columns["camera"] == 1])
    assert center[0] > 0.3
    assert center[-1] < 0.3 * center[0]


def test_other_houses_stand_along_the_same_streets(world: EmbeddedWorld, tmp_path: Path) -> None:
    anywhere = replace(TINY, before_signs=0.0)  # signs differ, too
    a, b = (recording(world, replace(anywhere, randomised=share), tmp_path / str(share)) for share in (0.0, 1.0))
    assert a.scenario == b.scenario
    assert (a.columns["relative_angle"] == b.columns["relative_angle"]).all()
    assert np.abs(a.image(0).astype(int) - b.image(0)).mean() > 3


def test_in_some_episodes_the_driver_is_not_told_of_cars(world: EmbeddedWorld) -> None:
    for share, kind in ((1.0, HiddenCarsOracle), (0.0, OraclePerception)):
        config = replace(TINY, hidden_cars=share)
        assert type(begun(world, config)[1].perception) is kind


def test_the_disturbed_command_and_the_clean_one_are_both_recorded(world: EmbeddedWorld, tmp_path: Path) -> None:
    moving = replace(TINY, duration=9.0, cars=0, people=0)
    frames = list(recording(world, moving, tmp_path, number=1))
    apart = [frame.driven != frame.clean for frame in frames if frame.camera == 0]
    assert 0.02 < np.mean(apart) < 0.6
