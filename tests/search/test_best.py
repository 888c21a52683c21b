"""Which blocks are trained again, and which of them is the best."""

from __future__ import annotations

from pathlib import Path

import pytest

from caldrive.perception.network.config import BlockConfig
from caldrive.search.best import (
    Retrained,
    RetrainingJob,
    best_of,
    candidates,
    conditioning_jobs,
    ranked,
    retrained,
    retraining_jobs,
    value_of,
)
from caldrive.search.config import SearchConfig
from caldrive.search.examples import Source
from caldrive.search.studies import FinishedTrial


def trial(draw: int, value: float, length: int = 5, pruned: bool = False) -> FinishedTrial:
    return FinishedTrial(draw, BlockConfig("gru", 10 + draw, length=length), value, pruned, seconds=1.0)


TRIALS = [
    trial(0, 0.5), trial(1, 0.4), trial(2, 0.1, pruned=True), trial(3, 0.9, length=1), trial(4, 0.3), trial(5, 0.8),
]  # fmt: skip


def test_whole_trials_come_before_pruned_ones_and_the_better_first() -> None:
    assert [trial.draw for trial in ranked("relative_angle", TRIALS)] == [4, 1, 0, 5, 3, 2]
    assert [trial.draw for trial in ranked("hazard_stop", TRIALS)] == [3, 5, 0, 1, 4, 2]


def test_as_many_are_trained_again_with_history_as_without() -> None:
    trials = [*TRIALS, trial(6, 0.85, length=1), trial(7, 0.95, length=1)]
    assert [trial.draw for trial in candidates("relative_angle", trials, 2)] == [4, 1, 6, 3]
    assert [trial.draw for trial in candidates("relative_angle", TRIALS, 2)] == [4, 1, 3]
    assert [trial.draw for trial in candidates("hazard_stop", TRIALS, 1)] == [3, 5]
    assert [trial.draw for trial in candidates("hazard_stop", TRIALS[:1], 3)] == [0]


def test_each_is_trained_with_each_seed() -> None:
    jobs = retraining_jobs("relative_angle", TRIALS, SearchConfig(best=1, seeds=2))
    assert [(job.draw, job.number) for job in jobs] == [(4, 0), (4, 1), (3, 0), (3, 1)]


def test_the_mean_over_the_seeds_decides() -> None:
    steady, lucky = Retrained(0, BlockConfig(), (0.5, 0.5)), Retrained(1, BlockConfig(), (0.1, 1.1))
    assert best_of("relative_angle", [lucky, steady]) is steady
    assert best_of("hazard_stop", [steady, lucky]) is lucky
    assert lucky.spread == pytest.approx(0.7071, abs=1e-4)
    assert Retrained(0, BlockConfig(), (0.5,)).spread == 0.0


def test_the_conditioning_that_was_trained_already_is_not_trained_again() -> None:
    best = Retrained(4, BlockConfig("gru", 14, length=5), (0.3,))
    again = {job.name for job in conditioning_jobs("relative_angle", best, SearchConfig(seeds=2))}
    assert len(again) == 3 * 2
    assert len(again & {job.name for job in retraining_jobs("relative_angle", TRIALS, SearchConfig(seeds=2))}) == 2


def test_a_damaged_score_ends_with_a_sentence(tmp_path: Path) -> None:
    source = Source(tmp_path, tmp_path, tmp_path, 0.0, 0)
    job = RetrainingJob("relative_angle", 4, BlockConfig(), 0)
    assert value_of(source, job) is None
    assert retrained(source, [job]) == []
    (tmp_path / "retrained").mkdir()
    for text in ("no score", "{}", '{"value": "much"}', '{"value": null}'):
        (tmp_path / "retrained" / job.name).write_text(text)
        with pytest.raises(ValueError, match=r"found that .*relative_angle-4-groups-0\.json is damaged"):
            value_of(source, job)
