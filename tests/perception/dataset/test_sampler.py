from __future__ import annotations

import numpy as np
import pytest

from caldrive.perception.dataset.frames import Frames
from caldrive.perception.dataset.sampler import Sampler
from caldrive.recordings.writer import EpisodeError
from tests.perception.data import HEIGHT, WIDTH

SIZE = (HEIGHT, WIDTH)


def test_rare_classes_are_drawn_more_often(frames: Frames) -> None:
    hazard = frames.column("hazard_stop")
    even, keen = (Sampler(frames, 1, balance, seed=0) for balance in (0.0, 1.0))
    assert hazard[even.draw(0, 2000)].mean() == pytest.approx(hazard.mean(), abs=0.04)
    assert hazard[keen.draw(0, 2000)].mean() > 1.5 * hazard.mean()


def test_junctions_are_drawn_more_often_than_the_streets_between(frames: Frames) -> None:
    inside = frames.column("junction")
    even, keen = (Sampler(frames, 1, balance, seed=0) for balance in (0.0, 1.0))
    assert inside[even.draw(0, 2000)].mean() == pytest.approx(inside.mean(), abs=0.04)
    assert inside[keen.draw(0, 2000)].mean() > 1.5 * inside.mean()


def test_class_counts_expect_what_is_drawn(frames: Frames) -> None:
    sampler = Sampler(frames, 3, 0.7, seed=0)
    ids = (sampler.draw(0, 4000)[:, None] + np.arange(3)).ravel()
    expected = sampler.class_counts()["hazard_stop"] / len(frames)
    assert expected.sum() == pytest.approx(1.0)
    assert frames.column("hazard_stop")[ids].mean() == pytest.approx(expected[1], abs=0.03)


def test_draws_depend_on_seed_and_step_only(frames: Frames) -> None:
    first, second = Sampler(frames, 3, 0.5, seed=1), Sampler(frames, 3, 0.5, seed=1)
    first.draw(0, 9)
    assert first.draw(7, 9).tolist() == second.draw(7, 9).tolist()
    assert first.draw(7, 9).tolist() != first.draw(8, 9).tolist()


def test_half_of_the_windows_may_be_seen_with_another_command(frames: Frames) -> None:
    sampler = Sampler(frames, 1, 0.5, seed=3)
    assert sampler.alternatives(7, 1000, 0.5).mean() == pytest.approx(0.5, abs=0.06)
    assert (sampler.alternatives(7, 1000, 0.5) == sampler.alternatives(7, 1000, 0.5)).all()
    assert (sampler.alternatives(7, 1000, 0.5) != sampler.alternatives(8, 1000, 0.5)).any()


def test_a_window_longer_than_every_stream_is_refused(frames: Frames) -> None:
    with pytest.raises(EpisodeError, match="type a smaller --window"):
        Sampler(frames, 21, 0.5, seed=0)
