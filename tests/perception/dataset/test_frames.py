from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from caldrive.affordances import BY_NAME
from caldrive.datatypes import Control
from caldrive.perception.dataset.frames import Frames
from caldrive.perception.dataset.sampler import rarity
from caldrive.recordings.folder import find_episodes
from caldrive.recordings.writer import EpisodeError, EpisodeWriter
from tests.perception.data import HEIGHT, SCENARIO, WIDTH, make_frame

SIZE = (HEIGHT, WIDTH)


def test_a_window_stays_in_one_stream(frames: Frames) -> None:
    starts = frames.window_starts(5)
    assert len(starts) == 4 * 2 * 16
    assert (frames.stream_start[starts] == frames.stream_start[starts + 4]).all()


def test_a_gap_in_the_frames_begins_a_new_stream(tmp_path: Path) -> None:
    with EpisodeWriter(tmp_path / "gap.parquet", SCENARIO) as writer:
        for index in (0, 1, 2, 7, 8):
            writer.append(make_frame(index))
    assert Frames(find_episodes(tmp_path), SIZE).stream_start.tolist() == [0, 0, 0, 3, 3]


def test_overlapping_windows_share_their_frames(frames: Frames) -> None:
    batch = frames.batch(np.array([5, 7]), window=4, context=3)
    assert len(batch.images) == 9
    assert batch.index.tolist() == [[0, 1, 2, 3, 4, 5, 6], [2, 3, 4, 5, 6, 7, 8]]
    assert batch.group.tolist() == [0] * 7 + [1] * 2
    assert batch.targets["center_distance"].shape == (8,)
    expected = frames.column("center_distance")[[5, 6, 7, 8, 7, 8, 9, 10]] / 1.65
    np.testing.assert_allclose(batch.targets["center_distance"].numpy(), expected, rtol=1e-5)


def test_history_before_a_stream_is_its_first_frame(frames: Frames) -> None:
    batch = frames.batch(np.array([21]), window=2, context=3)  # the second camera's second frame
    assert batch.index.tolist() == [[0, 0, 0, 1, 2]]


def test_images_from_memory_and_from_jpeg_are_the_same(folder: Path, frames: Frames) -> None:
    cached = Frames(find_episodes(folder), SIZE, cache_gb=1.0)
    ids = np.array([3, 90, 41])
    np.testing.assert_array_equal(cached.images(ids), frames.images(ids))


def test_the_digest_depends_on_the_images(folder: Path) -> None:
    episodes = find_episodes(folder)
    same, brighter = Frames(episodes, SIZE), replace(episodes[0], jpegs=[jpeg + b"0" for jpeg in episodes[0].jpegs])
    assert Frames(find_episodes(folder), SIZE).digest == same.digest
    assert Frames([brighter, *episodes[1:]], SIZE).digest != same.digest


def test_another_image_size_is_refused(folder: Path) -> None:
    with pytest.raises(EpisodeError, match=r"images of 64 x 32 .* wanted 200 x 88"):
        Frames(find_episodes(folder), (88, 200), cache_gb=1.0)


def test_another_command_changes_what_depends_on_it_and_nothing_else(frames: Frames) -> None:
    ids = np.arange(12)[:, None]  # the commands change every four frames: left, straight, right
    command, targets = frames.commands_and_targets(ids)
    alternative_command, alternative_targets = frames.commands_and_targets(ids, np.arange(12) != 11)
    assert command[:, 0].tolist() == [0] * 4 + [1] * 4 + [2] * 4
    assert alternative_command[:, 0].tolist() == [0] * 4 + [1] * 4 + [0] * 3 + [2]
    scale = BY_NAME["relative_angle"].scale
    angles, alternative_angles = (by_name["relative_angle"].numpy() for by_name in (targets, alternative_targets))
    assert angles * scale == pytest.approx(0.1)
    assert alternative_angles * scale == pytest.approx(np.array([0.1] * 8 + [0.3] * 3 + [0.1]))
    assert all((targets[name] == alternative_targets[name]).all() for name in targets if name != "relative_angle")


def test_a_batch_may_ask_what_another_command_would(frames: Frames) -> None:
    starts = np.array([0, 8])
    batch = frames.batch(starts, 2, 3, np.array([True, True]))
    assert batch.command.tolist() == [[0, 0], [0, 0]]
    assert frames.batch(starts, 2, 3).command.tolist() == [[0, 0], [2, 2]]


def test_a_frame_of_a_waiting_car_counts_less_than_one_of_a_car_that_may_go(tmp_path: Path) -> None:
    with EpisodeWriter(tmp_path / "waits.parquet", SCENARIO) as writer:
        for index in range(8):
            clean = Control(brake=1.0) if index in (0, 1, 4, 5) else Control(throttle=0.5)
            writer.append(replace(make_frame(index), speed=0.0 if index < 4 else 5.0, clean=clean))
    frames = Frames(find_episodes(tmp_path), SIZE)
    assert rarity(frames, 0.5)[0] == pytest.approx(0.5 * rarity(frames, 0.5)[2])  # it stands: for a reason, and without
    assert rarity(frames, 0.5)[4] == rarity(frames, 0.5)[6]  # it drives, braking or not
