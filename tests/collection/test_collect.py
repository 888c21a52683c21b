"""A recording can be broken off at any moment, and ends like an unbroken one."""

from __future__ import annotations

import math
import os
import shutil
import signal
import sys
from collections.abc import Iterator
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest

from caldrive.collection import collect as collection
from caldrive.collection.collect import _record, _record_bytes, collect
from caldrive.collection.config import CollectConfig
from caldrive.datatypes import Control
from caldrive.driving.settings import WorldSettings
from caldrive.files import locked_folder
from caldrive.world.embedded import EmbeddedWorld
from tests.parallel import fake_ray

TINY = CollectConfig(
    "town02",
    (1, 6),
    episodes=3,
    duration=2.0,
    cars=6,
    people=10,
    tailgating=0.4,
    width=48,
    height=24,
    semantic=True,
    seed=4,
)


@pytest.fixture(autouse=True)
def _fresh() -> Iterator[None]:
    """Each test begins like a new process and leaves nothing running."""
    collection._close_world()
    yield
    collection._close_world()


@pytest.fixture(scope="module")
def unbroken(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("unbroken")
    assert [k for k, _ in collect(TINY, folder)] == [0, 1, 2]
    return folder


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.glob("*.parquet")}


def test_a_recording_broken_off_between_episodes_ends_like_an_unbroken_one(unbroken: Path, tmp_path: Path) -> None:
    recording = collect(TINY, tmp_path)
    next(recording)
    recording.close()  # type: ignore[attr-defined]
    first = contents(tmp_path)
    assert list(first) == ["episode-00000.parquet"]
    collection._close_world()
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


def test_two_recordings_in_one_folder_at_once_are_refused(tmp_path: Path) -> None:
    with locked_folder(tmp_path), pytest.raises(ValueError, match="found another process at work"):
        next(collect(TINY, tmp_path))


def test_a_finished_recording_has_nothing_left_to_do(unbroken: Path) -> None:
    before = contents(unbroken)
    assert list(collect(TINY, unbroken)) == []
    assert contents(unbroken) == before


def test_a_damaged_episode_is_recorded_again(unbroken: Path, tmp_path: Path) -> None:
    shutil.copytree(unbroken, tmp_path / "damaged")
    path = tmp_path / "damaged" / "episode-00001.parquet"
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)
    assert [k for k, _ in collect(TINY, tmp_path / "damaged")] == [1]
    assert contents(tmp_path / "damaged") == contents(unbroken)


def test_a_folder_with_a_recording_of_other_settings_is_left_alone(unbroken: Path) -> None:
    before = contents(unbroken)
    with pytest.raises(ValueError, match="a recording with seed 4, wanted 5"):
        next(collect(replace(TINY, seed=5, episodes=4), unbroken))
    assert contents(unbroken) == before


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"town": "town09"}, "found town 'town09'"),
        ({"weathers": (1, 15)}, "found weather 15"),
        ({"weathers": ()}, "no weather"),
        ({"width": 0}, "found --width 0"),
        ({"duration": math.nan}, "found --duration nan"),
        ({"episodes": 0}, "found --episodes 0"),
        ({"seed": -1}, "found --seed -1"),
        ({"cars": 400}, "found --cars 400"),
        ({"people": 40_000}, "found --people 40000"),
        ({"crossing": -1.0}, "found --crossing -1"),
        ({"before_signs": 1.5}, "found --before-signs 1.5, wanted 0.0 to 1.0: type --before-signs 0.35"),
        ({"before_turns": math.nan}, "found --before-turns nan"),
        ({"displaced": -0.1}, "found --displaced -0.1"),
        ({"hidden_cars": 2.0}, "found --hidden-cars 2"),
        ({"tailgating": 20.0}, "found --tailgating 20"),
        ({"cars": 10**7}, r"found --cars 10000000, wanted 0 to \d+"),
        ({"people": 10**9}, r"found --people 1000000000, wanted 0 to \d+"),
        ({"episodes": 10**9}, "found --episodes 1000000000, wanted 1 to 100000"),
    ],
)
def test_what_cannot_be_recorded_is_said_before_anything_is_written(
    tmp_path: Path, change: dict[str, Any], message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        next(collect(replace(TINY, **change), tmp_path / "new"))
    assert not (tmp_path / "new").exists()


def test_a_recording_is_not_continued_with_other_code(unbroken: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(collection, "code_version", lambda: "another")
    with pytest.raises(ValueError, match="wanted another: give another --out"):
        next(collect(replace(TINY, episodes=4), unbroken))


def test_fewer_episodes_than_before_are_no_smaller_recording(unbroken: Path) -> None:
    before = contents(unbroken)
    assert not list(collect(replace(TINY, episodes=1), unbroken))
    assert contents(unbroken) == before


def test_a_folder_without_episodes_takes_other_settings(unbroken: Path, tmp_path: Path) -> None:
    collection._claim(tmp_path, replace(TINY, cars=7))
    recording = collect(TINY, tmp_path)
    next(recording)
    recording.close()  # type: ignore[attr-defined]
    assert contents(tmp_path).items() <= contents(unbroken).items()
    assert (tmp_path / "manifest.json").read_bytes() == (unbroken / "manifest.json").read_bytes()


@pytest.mark.parametrize("manifest", ["", "[1]", '{"town"'])
def test_a_damaged_manifest_is_named(tmp_path: Path, manifest: str) -> None:
    (tmp_path / "manifest.json").write_text(manifest)
    (tmp_path / "episode-00000.parquet").write_bytes(b"")
    with pytest.raises(ValueError, match=r"manifest\.json is damaged"):
        next(collect(TINY, tmp_path))


def test_episodes_of_unknown_origin_are_not_added_to(tmp_path: Path) -> None:
    (tmp_path / "episode-00000.parquet").write_bytes(b"")
    with pytest.raises(ValueError, match="says how they came"):
        next(collect(TINY, tmp_path))


def _dies_once(config: CollectConfig, folder: Path, number: int, world: WorldSettings) -> int:
    mark = folder / "died"
    if number == 1 and not mark.exists():
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return _record(config, folder, number, world)


def test_workers_that_die_are_replaced_and_the_recording_is_the_unbroken_one(
    unbroken: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(collection, "_record", _dies_once)
    list(collect(TINY, tmp_path, workers=2))
    assert contents(tmp_path) == contents(unbroken)


def test_machines_without_a_common_disk_record_the_same_bytes(
    unbroken: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    ray = fake_ray.install(monkeypatch, processors=1)
    assert sorted(k for k, _ in collect(TINY, tmp_path, ray="auto")) == [0, 1, 2]
    assert contents(tmp_path) == contents(unbroken)
    assert ray.address == "auto"


@pytest.mark.skipif(find_spec("ray") is None, reason="Ray is not installed")
def test_rays_workers_record_the_same_bytes(unbroken: Path, tmp_path: Path) -> None:
    assert sorted(k for k, _ in collect(TINY, tmp_path, workers=2, ray="local")) == [0, 1, 2]
    assert contents(tmp_path) == contents(unbroken)


def test_a_recording_on_a_cluster_that_is_broken_off_goes_on(
    unbroken: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    ray = fake_ray.install(monkeypatch, processors=1)
    recording = collect(TINY, tmp_path, ray="auto")
    first, _ = next(recording)
    recording.close()  # type: ignore[attr-defined]
    assert not ray.is_running
    assert sorted(k for k, _ in collect(TINY, tmp_path)) == sorted({0, 1, 2} - {first})
    assert contents(tmp_path) == contents(unbroken)


def test_a_machine_of_the_cluster_with_other_code_is_refused() -> None:
    with pytest.raises(ValueError, match=r"found behaviour-\d+ on a machine of the cluster, wanted another"):
        _record_bytes(TINY, "another", 0)


def test_without_ray_nothing_is_begun(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "ray", None)
    with pytest.raises(RuntimeError, match=r"pip install 'caldrive\[ray\]'"):
        next(collect(TINY, tmp_path / "new", ray="local"))
    assert not (tmp_path / "new").exists()


def test_a_town_that_only_judges_is_not_recorded(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"found random:9000000 to learn from, wanted a seed below 9000000"):
        next(collect(replace(TINY, town="random:9000000"), tmp_path / "out"))
    assert not (tmp_path / "out").exists()
