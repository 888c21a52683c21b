"""The settings of a search and their limits."""

from __future__ import annotations

from typing import Any

import pytest

from caldrive.affordances import CONDITIONAL, SPECS
from caldrive.search.config import CONDITIONAL_TASKS, TASKS, SearchConfig


@pytest.mark.parametrize(
    ("settings", "sentence"),
    [
        ({"trials": 0}, "found --trials 0, wanted 1 to 100000: type --trials 40"),
        ({"evaluations": 0}, "found --evaluations 0"),
        ({"validation_share": 1.0}, "found --validation-share 1.0, wanted 0.0 to 0.9"),
        ({"learning_rate": float("nan")}, "found --learning-rate nan"),
        ({"tasks": ("speed",)}, "found --tasks speed, wanted some of hazard_stop, red_light"),
        ({"tasks": ()}, "found --tasks none, wanted some of"),
        ({"tasks": ("red_light", "red_light")}, "found --tasks red_light red_light, wanted some of"),
        (
            {"tasks": ("red_light",), "conditioning": True},
            "found --conditioning with --tasks red_light, .*, wanted relative_angle or center_distance among them",
        ),
    ],
)
def test_settings_that_cannot_be_are_named(settings: dict[str, Any], sentence: str) -> None:
    with pytest.raises(ValueError, match=sentence):
        SearchConfig(**settings)


def test_a_task_is_an_affordance() -> None:
    assert list(TASKS) == [spec.name for spec in SPECS]
    assert list(CONDITIONAL_TASKS) == [spec.name for spec in CONDITIONAL]


def test_ways_to_tell_the_command_are_compared_where_one_task_is_told_it() -> None:
    assert SearchConfig(tasks=("red_light", "center_distance"), conditioning=True).conditioning


def test_more_trials_or_tasks_go_on_with_the_same_search() -> None:
    assert SearchConfig(trials=7, tasks=("red_light",)).decisive() == SearchConfig().decisive()
    assert SearchConfig(steps=7).decisive() != SearchConfig().decisive()
