from __future__ import annotations

import os
import signal
from functools import partial
from pathlib import Path

import pytest

from caldrive.driving.pool import spread


def _square(k: int) -> int:
    return k * k


def _dies_at_first(folder: Path, k: int) -> int:
    mark = folder / f"died-{k}"
    if k % 3 == 1 and not mark.exists():
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return k * k


def _dies(k: int) -> int:
    os.kill(os.getpid(), signal.SIGKILL)
    return k


def _fails(k: int) -> int:
    raise ValueError(f"found {k}")


@pytest.mark.parametrize("workers", [1, 2])
def test_all_work_is_done_once(workers: int) -> None:
    assert sorted(spread(_square, range(7), workers)) == [(k, k * k) for k in range(7)]


def test_the_work_of_workers_that_die_is_done_again(tmp_path: Path) -> None:
    assert sorted(spread(partial(_dies_at_first, tmp_path), range(6), 2)) == [(k, k * k) for k in range(6)]
    assert len(list(tmp_path.iterdir())) == 2


def test_workers_that_always_die_are_given_up() -> None:
    with pytest.raises(RuntimeError, match="type --workers 1"):
        list(spread(_dies, range(3), 2))


@pytest.mark.parametrize("workers", [1, 2])
def test_an_error_in_the_work_ends_it(workers: int) -> None:
    with pytest.raises(ValueError, match="found 0"):
        list(spread(_fails, [0], workers))
