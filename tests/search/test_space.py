"""The space of blocks: the supplement's ranges, and no parameter that a block does not have."""

from __future__ import annotations

from collections import Counter

import optuna

from caldrive.affordances import SPECS
from caldrive.perception.evaluation.report import PUBLISHED as PUBLISHED_FIGURES
from caldrive.perception.network.config import BlockConfig
from caldrive.search.examples import HISTORY
from caldrive.search.space import LONGEST_SPAN, PUBLISHED, PUBLISHED_TEMPORAL, block_of, suggest_block

LIKE = BlockConfig(norm="layer", conditioning="input")


def drawn(n: int) -> list[tuple[BlockConfig, optuna.trial.FrozenTrial]]:
    study = optuna.create_study(sampler=optuna.samplers.RandomSampler(seed=0))
    blocks = []
    for _ in range(n):
        trial = study.ask()
        blocks.append((suggest_block(trial, LIKE), study.tell(trial, 0.0)))
    return blocks


def test_blocks_lie_within_the_supplements_ranges_and_fill_them() -> None:
    blocks = [block for block, _ in drawn(400)]
    temporal = [block for block in blocks if block.temporal]
    assert set(Counter(block.layer for block in blocks)) == {"dense", "gru", "lstm", "tconv"}
    for values, low, high in (
        ([block.nodes for block in blocks], 10, 200),
        ([block.dropout for block in blocks], 0.25, 0.75),
        ([block.length for block in temporal], 2, 20),
        ([block.dilation for block in temporal], 1, 3),
    ):
        assert low <= min(values) <= low + 0.1 * (high - low)
        assert high - 0.1 * (high - low) <= max(values) <= high
    assert all((block.norm, block.conditioning) == ("layer", "input") for block in blocks)


def test_a_block_has_no_parameter_that_means_nothing() -> None:
    for block, trial in drawn(200):
        assert ("length" in trial.params) == (block.layer != "dense")
        assert ("dilation" in trial.params) == block.temporal
        assert block.temporal or (block.length, block.dilation) == (1, 1)


def test_a_finished_trial_gives_its_block_again() -> None:
    assert all(block_of(trial.params, LIKE) == block for block, trial in drawn(20))


def test_every_block_sees_its_whole_history_on_the_frames_that_count() -> None:
    assert LONGEST_SPAN == 58 < HISTORY


def test_the_supplements_blocks_and_figures_are_there_for_every_task() -> None:
    assert set(PUBLISHED_TEMPORAL) == {spec.name for spec in SPECS}
    for spec in SPECS:
        without, with_history = PUBLISHED_TEMPORAL[spec.name]
        assert (with_history > without) == spec.discrete  # history helps every task
        assert with_history == PUBLISHED_FIGURES[spec.name]
        assert 10 <= getattr(PUBLISHED, spec.name).nodes <= 200
