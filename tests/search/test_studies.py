"""Trials: the same by seed and number, pruned, killed anywhere and gone on with, by several processes."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import optuna
import pytest

from caldrive.parallel.processes import parallel_map
from caldrive.parallel.trials import JOURNAL, mend_journal, require_optuna
from caldrive.search import studies
from caldrive.search.config import SearchConfig
from caldrive.search.examples import Source, load_examples
from caldrive.search.learning import evaluation_step
from caldrive.search.space import suggest_block
from caldrive.search.studies import (
    FinishedTrial,
    TrialJob,
    finished_trials,
    importances,
    missing_jobs,
    open_study,
    run_trial,
)
from tests.search.data import TINY_SEARCH, Work

ANGLE = replace(TINY_SEARCH, tasks=("relative_angle",))


@pytest.fixture
def own(source: Source, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Source:
    """A folder of its own, with the same examples."""
    examples = load_examples(source)
    monkeypatch.setattr(studies, "worker_examples", lambda _: examples)
    return replace(source, out=tmp_path)


def run_all(source: Source, config: SearchConfig) -> list[FinishedTrial]:
    for job in missing_jobs(source, config):
        run_trial(source, config, job)
    return finished_trials(source, config, config.tasks[0])


def essence(trials: list[FinishedTrial]) -> list[FinishedTrial]:
    """Without how long they took."""
    return [replace(trial, seconds=0.0) for trial in trials]


def test_a_trial_depends_on_the_seed_and_its_number_only(own: Source) -> None:
    there = replace(own, out=own.out / "there")
    there.out.mkdir()
    order = [run_trial(own, ANGLE, TrialJob("relative_angle", draw)) for draw in (0, 1, 2)]
    assert [run_trial(there, ANGLE, TrialJob("relative_angle", draw)) for draw in (2, 1, 0)] == order[::-1]
    assert essence(finished_trials(own, ANGLE, "relative_angle")) == essence(
        finished_trials(there, ANGLE, "relative_angle")
    )
    other = replace(ANGLE, seed=1)
    assert run_trial(there, other, TrialJob("relative_angle", 3)) != run_trial(
        own, ANGLE, TrialJob("relative_angle", 3)
    )


def test_one_set_of_parameters_is_drawn_for_all_tasks(own: Source) -> None:
    run_all(own, TINY_SEARCH)
    hazard, angle = (finished_trials(own, TINY_SEARCH, task) for task in TINY_SEARCH.tasks)
    assert [replace(trial.block, norm="none") for trial in hazard] == [
        replace(trial.block, norm="none") for trial in angle
    ]
    assert len({trial.block for trial in hazard}) == TINY_SEARCH.trials


@pytest.mark.parametrize("place", ["suggest_block", "measured_training"])
def test_a_killed_search_goes_on_to_the_same_trials(place: str, own: Source, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = replace(own, out=own.out / "whole")
    whole.out.mkdir()
    expected = run_all(whole, ANGLE)
    original, calls = getattr(studies, place), list[None]()

    def killed(*arguments: Any) -> Any:
        calls.append(None)
        if len(calls) == 3:
            raise KeyboardInterrupt
        return original(*arguments)

    monkeypatch.setattr(studies, place, killed)
    with pytest.raises(KeyboardInterrupt):
        run_all(own, ANGLE)
    assert [job.draw for job in missing_jobs(own, ANGLE)] == [2, 3]
    assert essence(run_all(own, ANGLE)) == essence(expected)
    assert missing_jobs(own, ANGLE) == []
    assert len(calls) == ANGLE.trials + 1
    states = [trial.state.name for trial in open_study(own.out, ANGLE, "relative_angle").trials]
    assert sorted(states) == ["COMPLETE"] * 4 + ["FAIL"]


def test_more_trials_go_on_with_those_that_are_done(own: Source) -> None:
    first = run_all(own, ANGLE)
    more = replace(ANGLE, trials=6)
    assert [job.draw for job in missing_jobs(own, more)] == [4, 5]
    assert run_all(own, more)[:4] == first


def test_a_trial_that_is_worse_than_the_median_is_pruned(own: Source, monkeypatch: pytest.MonkeyPatch) -> None:
    steps = [evaluation_step(ANGLE, k) for k in range(1, ANGLE.evaluations + 1)]
    errors = iter([0.1, 0.2, 0.3, 0.4, 0.5, 9.0, 0.25, 9.0])  # a trial each; five of them are never pruned
    monkeypatch.setattr(
        studies,
        "measured_training",
        lambda *_, errors=errors: iter([(step, e) for e in [next(errors)] for step in steps]),
    )
    blocks = iter([True] * 7 + [False])
    monkeypatch.setattr(studies, "suggest_block", lambda trial, like: replace(like, length=2 if next(blocks) else 1))
    config = replace(ANGLE, trials=8)
    for job in missing_jobs(own, config):
        run_trial(own, config, job)
    states = open_study(own.out, config, "relative_angle").trials
    assert [trial.state.name for trial in states] == ["COMPLETE"] * 5 + ["PRUNED"] + ["COMPLETE"] * 2
    assert list(states[5].intermediate_values) == steps[:2]  # not before it was measured twice
    assert states[5].value == 9.0
    assert missing_jobs(own, config) == []  # a pruned trial is done


def test_another_sampler_learns_from_earlier_trials(own: Source, monkeypatch: pytest.MonkeyPatch) -> None:
    config = replace(ANGLE, sampler="tpe", trials=30)
    monkeypatch.setattr(studies, "measured_training", lambda *_: iter([]))
    study = open_study(own.out, config, "relative_angle")
    for draw in range(config.trials):
        study = open_study(own.out, config, "relative_angle", draw)
        trial = study.ask()
        block = suggest_block(trial, studies.own_block(own, "relative_angle"))
        study.tell(trial, float(block.nodes))  # the fewer, the better
    nodes = [trial.params["nodes"] for trial in study.trials]
    assert sum(nodes[20:]) < 0.7 * sum(nodes[:10])


def test_a_line_that_was_cut_off_and_a_lock_that_was_left_are_no_hindrance(own: Source) -> None:
    expected = run_all(own, ANGLE)
    journal = own.out / JOURNAL
    with journal.open("ab") as file:
        file.write(b'{"op_code":4,"worker_id":"somebody')
    journal.with_name("journal.log.lock").symlink_to(journal)
    mend_journal(own.out)
    assert run_all(own, replace(ANGLE, trials=5))[:4] == expected


def test_a_damaged_journal_ends_with_a_sentence(own: Source) -> None:
    (own.out / JOURNAL).write_text("no journal\n" * 3)
    with pytest.raises(ValueError, match=r"found that .*journal\.log is damaged .* give another --out"):
        missing_jobs(own, ANGLE)


def test_several_processes_do_each_trial_once(source: Source, tmp_path: Path) -> None:
    own = replace(source, out=tmp_path)
    (tmp_path / "features").symlink_to(source.out / "features")
    jobs = missing_jobs(own, ANGLE)
    assert len(list(parallel_map(Work(own, ANGLE), jobs, workers=2))) == 4
    assert missing_jobs(own, ANGLE) == []
    assert [trial.draw for trial in finished_trials(own, ANGLE, "relative_angle")] == [0, 1, 2, 3]


def test_what_matters_is_said_once_there_are_enough_trials(own: Source, monkeypatch: pytest.MonkeyPatch) -> None:
    assert importances(own, ANGLE, "relative_angle") == {}
    for draw in range(30):
        study = open_study(own.out, ANGLE, "relative_angle", draw)
        trial = study.ask()
        block = suggest_block(trial, studies.own_block(own, "relative_angle"))
        study.tell(trial, float(block.nodes))
    shares = importances(own, ANGLE, "relative_angle")
    assert max(shares, key=lambda name: shares[name]) == "nodes"
    assert sum(shares.values()) == pytest.approx(1.0)


def test_without_optuna_a_sentence_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "optuna", None)
    with pytest.raises(RuntimeError, match=r"found no Optuna, wanted it for a search: type pip install 'caldrive\[se"):
        require_optuna()


def test_optuna_keeps_quiet(own: Source, capfd: pytest.CaptureFixture[str]) -> None:
    run_trial(own, ANGLE, TrialJob("relative_angle", 0))
    assert optuna.logging.get_verbosity() == optuna.logging.ERROR
    assert capfd.readouterr() == ("", "")
