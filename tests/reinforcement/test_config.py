"""The curriculum moves on when most goals are reached, and keeps what came before."""

from __future__ import annotations

from caldrive.reinforcement.config import Curriculum

TASKS = ("straight", "one-turn", "navigation")


def test_it_moves_on_when_enough_of_the_last_episodes_reached_their_goal() -> None:
    curriculum = Curriculum(TASKS, advance_at=0.8, window=5)
    assert curriculum.drawn() == ("straight",)
    ends = [False, True, True, False, True, True]
    assert [curriculum.note("straight", end) for end in ends] == [False] * 5 + [True]
    assert curriculum.level == 1
    assert curriculum.recent == []


def test_only_the_newest_task_counts_and_the_last_one_stays() -> None:
    curriculum = Curriculum(TASKS, advance_at=0.8, window=2, level=1)
    assert not any(curriculum.note("straight", True) for _ in range(5))
    assert [curriculum.note("one-turn", True) for _ in range(2)] == [False, True]
    assert not any(curriculum.note("navigation", True) for _ in range(5))


def test_half_of_the_episodes_are_of_the_newest_task() -> None:
    for level in (1, 2):
        drawn = Curriculum(TASKS, 0.8, 2, level=level).drawn()
        assert drawn.count(TASKS[level]) * 2 == len(drawn)
        assert set(drawn) == set(TASKS[: level + 1])


def test_without_a_share_all_tasks_are_driven_at_once() -> None:
    assert Curriculum(TASKS, advance_at=0.0, window=2).drawn() == TASKS


def test_it_moves_on_in_any_case_when_a_tasks_share_of_the_decisions_is_over() -> None:
    found = Curriculum(("straight", "one-turn", "navigation", "navigation-dynamic"), advance_at=0.8, window=2)
    assert [found.keep_up(share) for share in (0.1, 0.24, 0.26, 0.3, 0.51, 1.0)] == [
        False, False, True, False, True, True,
    ]  # fmt: skip
    assert found.level == 3
