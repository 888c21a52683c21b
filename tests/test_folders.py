from __future__ import annotations

from pathlib import Path

import pytest

from caldrive.episodes import EpisodeError
from caldrive.perception.folders import find_episodes, split
from tests.perception_data import HEIGHT, WIDTH

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
