"""Checking a recording: what it holds, and which files are no use."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from caldrive.affordances import CONTINUOUS
from caldrive.recordings.check import BINS, check_recording, draw_histograms
from caldrive.recordings.writer import EpisodeError, EpisodeWriter
from tests.perception.data import SCENARIO, make_frame, record


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return record(tmp_path, n_episodes=2, n_frames=11)


def test_a_sound_recording_is_counted(folder: Path) -> None:
    summary, episodes = check_recording(folder)
    assert (summary.episodes, summary.frames, summary.damaged) == (2, 2 * 11 * 2, ())
    assert summary.minutes == pytest.approx(2 * 1.0 / 60)
    assert summary.weathers == {"1": 2}
    assert sum(summary.counts["hazard_stop"].values()) == summary.frames
    assert set(summary.counts["command"]) == {"left", "straight", "right"}
    assert len(episodes) == 2


def test_a_cut_file_and_a_broken_image_are_named_and_the_rest_is_counted(folder: Path) -> None:
    cut, spoilt = sorted(folder.iterdir())
    content = spoilt.read_bytes()
    at = content.index(b"\xff\xd8\xff", len(content) // 2)  # where a JPEG begins
    spoilt.write_bytes(content[:at] + b"\x00\x00\x00" + content[at + 3 :])
    cut.write_bytes(cut.read_bytes()[:1000])
    record(folder / "more", n_episodes=1, n_frames=5)
    summary, _ = check_recording(folder)
    assert summary.episodes == 1
    assert [name in sentence for name, sentence in zip((cut.name, spoilt.name), summary.damaged, strict=True)] == [
        True
    ] * 2


def test_episodes_that_were_asked_for_and_are_not_there_are_counted(tmp_path: Path) -> None:
    record(tmp_path, n_episodes=1, n_frames=11)
    (tmp_path / "episode0.parquet").rename(tmp_path / "episode-00001.parquet")
    (tmp_path / "manifest.json").write_text('{"episodes": 5, "width": 64, "height": 32}')
    summary, _ = check_recording(tmp_path)
    assert (summary.episodes, summary.missing, summary.damaged) == (1, 4, ())


MANIFESTS = ["", "[1]", "{}", *(f'{{"episodes": {n}, "width": 64, "height": 32}}' for n in ('"five"', -1, 2.5, "true"))]


@pytest.mark.parametrize("manifest", MANIFESTS)
def test_a_damaged_manifest_is_named(folder: Path, manifest: str) -> None:
    (folder / "manifest.json").write_text(manifest)
    summary, _ = check_recording(folder)
    assert (summary.episodes, summary.missing) == (2, 0)
    assert "manifest.json is damaged" in summary.damaged[0]


@pytest.mark.parametrize(
    "wrong", [{"image": np.zeros((16, 16, 3), np.uint8)}, {"semantic": np.full((32, 64), 99, np.uint8)}]
)
def test_images_that_are_none_of_the_recorders_are_named(wrong: dict[str, Any], tmp_path: Path) -> None:
    sound = replace(make_frame(0), semantic=np.zeros((32, 64), np.uint8))
    with EpisodeWriter(tmp_path / "a.parquet", SCENARIO) as writer:
        writer.append(sound)
        writer.append(replace(sound, index=1, time=0.1, **wrong))
    summary, episodes = check_recording(tmp_path)
    assert not episodes
    assert "row 1 of" in summary.damaged[0]


def test_an_episode_that_is_there_again_is_named(folder: Path) -> None:
    (folder / "again.parquet").write_bytes((folder / "episode1.parquet").read_bytes())
    summary, _ = check_recording(folder)
    assert len(summary.damaged) == 1
    assert "episode1.parquet has id, town, weather and seed of" in summary.damaged[0]


def test_an_episode_of_another_size_is_named(tmp_path: Path) -> None:
    for name, height in {"a": 16, "b": 32, "c": 32}.items():
        with EpisodeWriter(tmp_path / f"{name}.parquet", SCENARIO) as writer:
            writer.append(replace(make_frame(0), image=np.zeros((height, 64, 3), np.uint8)))
    summary, _ = check_recording(tmp_path)
    assert [sentence.partition(" has ")[2][:17] for sentence in summary.damaged] == ["images of 64 x 16"]


def test_an_empty_folder_says_what_to_type(tmp_path: Path) -> None:
    with pytest.raises(EpisodeError, match="caldrive collect"):
        check_recording(tmp_path)


def test_histograms_are_a_picture(folder: Path, tmp_path: Path) -> None:
    summary, episodes = check_recording(folder)
    draw_histograms(episodes, summary.counts, tmp_path / "new" / "page.png")
    assert (tmp_path / "new" / "page.png").read_bytes().startswith(b"\x89PNG")


def test_every_continuous_affordance_has_its_histogram() -> None:
    assert {spec.name for spec in CONTINUOUS} <= set(BINS)


def test_a_folder_that_asked_for_more_episodes_than_anyone_records_is_counted_at_once(folder: Path) -> None:
    (folder / "manifest.json").write_text('{"episodes": 1000000000000, "width": 64, "height": 32}')
    assert check_recording(folder)[0].missing == 10**12


def test_images_of_another_size_than_their_folder_says_are_named(folder: Path) -> None:
    (folder / "manifest.json").write_text('{"episodes": 2, "width": 200, "height": 88}')
    summary, _ = check_recording(folder)
    assert "images of 64 x 32, its folder says 200 x 88" in summary.damaged[0]
    assert len(summary.damaged) == 2
