"""The recorder: three cameras with labels of their own, and a recording that can be broken off at any moment."""

from __future__ import annotations

import math
import os
import signal
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from caldrive.config import CollectConfig
from caldrive.datatypes import Control
from caldrive.driving import collection
from caldrive.driving.collection import BASELINES, _record, collect, episode_path
from caldrive.driving.distracted import Tailgater
from caldrive.episode_reader import Episode, read_episode
from caldrive.episodes import EpisodeError
from caldrive.world.embedded import EmbeddedWorld
from caldrive.world.semantics import Semantic
from caldrive.world.traffic import stop_sumo

TINY = CollectConfig(
    "town02", (1, 6), episodes=3, duration=2.0, cars=6, people=10, tailgating=0.0, width=48, height=24, seed=4
)


@pytest.fixture(autouse=True)
def _fresh(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Each test begins like a new process and leaves nothing running."""
    monkeypatch.setattr(collection, "_world", None)
    yield
    if collection._world is not None:
        collection._world.close()
    stop_sumo()


@pytest.fixture(scope="module")
def unbroken(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("unbroken")
    assert [k for k, _ in collect(TINY, folder)] == [0, 1, 2]
    return folder


@pytest.fixture(scope="module")
def episode(unbroken: Path) -> Episode:
    return read_episode(episode_path(unbroken, 0))


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.glob("*.parquet")}


def test_every_moment_is_seen_by_three_cameras_at_their_baselines(episode: Episode) -> None:
    assert len(episode) == 3 * 20
    frames = list(episode)
    assert {(frame.camera, frame.camera_left) for frame in frames} == set(enumerate(BASELINES))
    assert {frame.image.shape for frame in frames} == {(24, 48, 3)}
    left, middle, right = ([frame.index for frame in frames if frame.camera == camera] for camera in range(3))
    assert left == middle == right == sorted(set(middle))


def test_a_camera_keeps_its_yaw_which_is_15_degrees_at_most(unbroken: Path) -> None:
    yaws = set()
    for k in range(3):
        columns = read_episode(episode_path(unbroken, k)).columns
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
            swing = 1.3 * (math.sin(left.camera_yaw) - math.sin(right.camera_yaw))
            assert b.center_distance - a.center_distance == pytest.approx(1.0 + swing, abs=0.05)
        turned = a.relative_angle - b.relative_angle
        assert turned == pytest.approx(right.camera_yaw - left.camera_yaw, abs=0.15)


def test_frames_inside_a_junction_are_marked(tmp_path: Path) -> None:
    before_turns = replace(TINY, episodes=1, duration=9.0, cars=0, people=0, before_signs=0.0, before_turns=1.0, seed=3)
    list(collect(before_turns, tmp_path))
    episode = read_episode(episode_path(tmp_path, 0))
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


def test_weathers_take_turns(unbroken: Path) -> None:
    assert [read_episode(episode_path(unbroken, k)).scenario.weather for k in range(3)] == [1, 6, 1]


def test_episodes_differ_in_start_and_seed(unbroken: Path) -> None:
    found = [read_episode(episode_path(unbroken, k)).scenario for k in range(3)]
    assert len({one.seed for one in found}) == len({one.start for one in found}) == 3


def test_a_recording_broken_off_between_episodes_ends_like_an_unbroken_one(unbroken: Path, tmp_path: Path) -> None:
    recording = collect(TINY, tmp_path)
    next(recording)
    recording.close()  # type: ignore[attr-defined]
    first = contents(tmp_path)
    assert list(first) == ["episode-00000.parquet"]
    collection._world = None
    assert [k for k, _ in collect(TINY, tmp_path)] == [1, 2]
    assert contents(tmp_path) == contents(unbroken)


def test_a_recording_killed_within_an_episode_leaves_no_half_file(
    unbroken: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    steps, go_on = [], EmbeddedWorld.step

    def break_off(world: EmbeddedWorld, control: Control) -> object:
        steps.append(control)
        if len(steps) == 30:
            raise KeyboardInterrupt
        return go_on(world, control)

    with monkeypatch.context() as patch:
        patch.setattr(EmbeddedWorld, "step", break_off)
        with pytest.raises(KeyboardInterrupt):
            list(collect(TINY, tmp_path))
    assert list(contents(tmp_path)) == ["episode-00000.parquet"]
    assert [k for k, _ in collect(TINY, tmp_path)] == [1, 2]
    assert contents(tmp_path) == contents(unbroken)


def test_a_finished_recording_has_nothing_left_to_do(unbroken: Path) -> None:
    before = contents(unbroken)
    assert list(collect(TINY, unbroken)) == []
    assert contents(unbroken) == before


def test_a_folder_with_a_recording_of_other_settings_is_left_alone(unbroken: Path) -> None:
    before = contents(unbroken)
    with pytest.raises(ValueError, match="a recording with seed 4, wanted 5"):
        next(collect(replace(TINY, seed=5, episodes=4), unbroken))
    assert contents(unbroken) == before


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"town": "town09"}, "found town 'town09'"),
        ({"weathers": (1, 15)}, "found weather 15"),
        ({"weathers": ()}, "no weather"),
        ({"width": 0}, "found --width 0"),
        ({"duration": math.nan}, "found --duration nan"),
        ({"episodes": 0}, "found --episodes 0"),
        ({"seed": -1}, "found --seed -1"),
    ],
)
def test_what_cannot_be_recorded_is_said_before_anything_is_written(
    tmp_path: Path, change: dict[str, Any], said: str
) -> None:
    with pytest.raises(ValueError, match=said):
        next(collect(replace(TINY, **change), tmp_path / "new"))
    assert not (tmp_path / "new").exists()


@pytest.mark.parametrize("manifest", ["", "[1]", '{"town"'])
def test_a_damaged_manifest_is_named(tmp_path: Path, manifest: str) -> None:
    (tmp_path / "manifest.json").write_text(manifest)
    with pytest.raises(ValueError, match=r"manifest\.json is damaged"):
        next(collect(TINY, tmp_path))


def test_episodes_of_unknown_origin_are_not_added_to(tmp_path: Path) -> None:
    (tmp_path / "episode-00000.parquet").write_bytes(b"")
    with pytest.raises(ValueError, match="says how they came"):
        next(collect(TINY, tmp_path))


def test_semantic_images_are_recorded_where_they_are_asked_for(unbroken: Path, tmp_path: Path) -> None:
    asked = replace(TINY, episodes=1, semantic=True)
    list(collect(asked, tmp_path))
    plain, found = (read_episode(episode_path(folder, 0), semantic=True) for folder in (unbroken, tmp_path))
    assert found.semantic(5).shape == found.image(5).shape[:2]
    assert Semantic.ROAD in found.semantic(5)
    assert found.jpegs == plain.jpegs
    assert read_episode(episode_path(tmp_path, 0)).semantics is None
    with pytest.raises(EpisodeError, match="record with --semantic"):
        plain.semantic(5)


def _dies_once(config: CollectConfig, folder: Path, number: int) -> int:
    mark = folder / "died"
    if number == 1 and not mark.exists():
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return _record(config, folder, number)


def test_workers_that_die_are_replaced_and_the_recording_is_the_unbroken_one(
    unbroken: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(collection, "_record", _dies_once)
    list(collect(TINY, tmp_path, workers=2))
    assert contents(tmp_path) == contents(unbroken)


def test_a_tailgater_drives_among_twice_the_cars_and_is_told_something_else() -> None:
    config, world = replace(TINY, before_signs=1.0), EmbeddedWorld()
    scenario, agent = collection._set_up(world, config, 0, True, np.random.default_rng(1))
    assert scenario.n_vehicles == 2 * config.cars
    assert isinstance(agent.perception, Tailgater)
    assert agent.controller.config.cap == 20.0
    assert collection._set_up(world, config, 0, False, np.random.default_rng(1))[0].n_vehicles <= config.cars
    world.close()


def test_some_episodes_begin_beside_their_lane_and_come_back(tmp_path: Path) -> None:
    aside = replace(TINY, episodes=1, duration=9.0, cars=0, people=0, displaced=1.0, before_turns=0.0)
    list(collect(aside, tmp_path))
    columns = read_episode(episode_path(tmp_path, 0)).columns
    center = np.abs(columns["center_distance"][columns["camera"] == 1])
    assert center[0] > 0.3
    assert center[-1] < 0.3 * center[0]


def test_other_houses_stand_along_the_same_streets(tmp_path: Path) -> None:
    same, other = (replace(TINY, episodes=1, rearranged=share) for share in (0.0, 1.0))
    for config, name in ((same, "same"), (other, "other")):
        list(collect(config, tmp_path / name))
    a, b = (read_episode(episode_path(tmp_path / name, 0)) for name in ("same", "other"))
    assert a.scenario == b.scenario
    assert (a.columns["relative_angle"] == b.columns["relative_angle"]).all()
    assert np.abs(a.image(0).astype(int) - b.image(0)).mean() > 3
