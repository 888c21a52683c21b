from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from caldrive.recordings.folder import class_counts, find_episodes, held_out, split
from caldrive.recordings.writer import EpisodeError, EpisodeWriter
from tests.perception.data import HEIGHT, SCENARIO, WIDTH, make_frame, record

SIZE = (HEIGHT, WIDTH)


def test_whole_episodes_are_held_out_and_always_the_same(folder: Path) -> None:
    episodes = find_episodes(folder)
    train, held = split(episodes, 0.05, seed=3)
    assert len(held) == 1
    assert {e.id for e in train} | {e.id for e in held} == {e.id for e in episodes}
    assert [e.id for e in split(episodes, 0.05, seed=3)[1]] == [e.id for e in held]


def test_one_episode_is_too_few(folder: Path, tmp_path: Path) -> None:
    with pytest.raises(EpisodeError, match="one each"):
        split(find_episodes(folder)[:1], 0.05, seed=0)
    with pytest.raises(EpisodeError, match="there is no episode"):
        find_episodes(tmp_path)


def test_an_episode_that_is_there_again_is_refused(tmp_path: Path) -> None:
    record(tmp_path, n_episodes=2, n_frames=3)
    (tmp_path / "again.parquet").write_bytes((tmp_path / "episode1.parquet").read_bytes())
    with pytest.raises(EpisodeError, match=r"has id, town, weather and seed of"):
        find_episodes(tmp_path)


def test_what_a_training_kept_for_validation_is_found_again_or_missed(folder: Path) -> None:
    episodes = find_episodes(folder)
    kept = [e.key for e in episodes[:2]]
    assert held_out(episodes, kept) == episodes[:2]
    for keys, found, wanted in (([], 0, 0), ([*kept, "town01-other"], 2, 3)):
        with pytest.raises(EpisodeError, match=f"found {found} of the {wanted} episodes"):
            held_out(episodes, keys)


def test_classes_turns_and_the_causes_of_hazards_are_counted(tmp_path: Path) -> None:
    with EpisodeWriter(tmp_path / "one.parquet", SCENARIO) as writer:
        for index, distance in enumerate((3.0, 5.0, 50.0, 50.0, 4.0, 50.0, 50.0, 50.0)):
            frame = make_frame(index, hazard=index < 4)
            writer.append(replace(frame, affordances=replace(frame.affordances, vehicle_distance=distance)))
    counts = class_counts(find_episodes(tmp_path))
    assert counts["hazard_stop"] == {"0": 4, "1": 4}
    assert counts["hazard_by"] == {"car ahead": 2, "person or car across": 2}
    assert counts["command"] == {"left": 4, "straight": 4}
    assert counts["turn"] == {"straight": 1}  # of the tiny frames each eighth lies in a junction
