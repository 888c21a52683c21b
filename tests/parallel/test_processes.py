from __future__ import annotations

import os
import signal
import time
import weakref
from collections.abc import Callable, Iterator
from functools import partial
from multiprocessing import get_context
from multiprocessing.process import BaseProcess
from pathlib import Path

import numpy as np
import pytest

from caldrive.parallel.processes import parallel_map
from tests.parallel.work import dies_at_first, fails, square


def _dies(k: int) -> int:
    os.kill(os.getpid(), signal.SIGKILL)
    return k


@pytest.mark.parametrize("workers", [1, 2])
def test_all_work_is_done_once(workers: int) -> None:
    assert sorted(parallel_map(square, range(7), workers)) == [(k, k * k) for k in range(7)]


def test_the_work_of_workers_that_die_is_done_again(tmp_path: Path) -> None:
    assert sorted(parallel_map(partial(dies_at_first, tmp_path), range(6), 2)) == [(k, k * k) for k in range(6)]
    assert len(list(tmp_path.iterdir())) == 2


def test_workers_that_always_die_are_given_up() -> None:
    with pytest.raises(RuntimeError, match="type --workers 1"):
        list(parallel_map(_dies, range(3), 2))


@pytest.mark.parametrize("workers", [1, 2])
def test_an_error_in_the_work_ends_it(workers: int) -> None:
    with pytest.raises(ValueError, match="found 0"):
        list(parallel_map(fails, [0], workers))


def _marks(folder: Path, k: int) -> int:
    (folder / f"{k}").touch()
    time.sleep(0.05)
    return k


def test_what_nobody_waits_for_any_more_is_not_done(tmp_path: Path) -> None:
    work = parallel_map(partial(_marks, tmp_path), range(100), 2)
    next(work)
    work.close()  # type: ignore[attr-defined]
    assert 1 <= len(list(tmp_path.iterdir())) < 20


def _sleeps(folder: Path, k: int) -> int:
    (folder / f"{os.getpid()}").touch()
    time.sleep(60)
    return k


def _lives(pid: int) -> bool:
    try:
        return "State:\tZ" not in Path(f"/proc/{pid}/status").read_text()
    except OSError:
        return False


@pytest.fixture
def sleepers(tmp_path: Path) -> Iterator[tuple[BaseProcess, list[int]]]:
    """A process whose two workers sleep, and their numbers."""
    parent = get_context("spawn").Process(target=_spread_sleepers, args=(tmp_path,))
    parent.start()
    _within_seconds(lambda: len(list(tmp_path.iterdir())) == 2)
    workers = [int(path.name) for path in tmp_path.iterdir()]
    assert len(workers) == 2
    assert all(map(_lives, workers))
    yield parent, workers
    parent.kill()
    parent.join()


def _within_seconds(true: Callable[[], bool]) -> bool:
    until = time.monotonic() + 60
    while not true() and time.monotonic() < until:
        time.sleep(0.05)
    return true()


def test_workers_end_with_the_process_that_they_work_for(sleepers: tuple[BaseProcess, list[int]]) -> None:
    parent, workers = sleepers
    parent.kill()
    parent.join()
    assert _within_seconds(lambda: not any(map(_lives, workers)))


def test_ctrl_c_ends_workers_without_a_word(
    sleepers: tuple[BaseProcess, list[int]], capfd: pytest.CaptureFixture[str]
) -> None:
    for worker in sleepers[1]:
        os.kill(worker, signal.SIGINT)
    assert _within_seconds(lambda: not any(map(_lives, sleepers[1])))
    assert "Traceback" not in capfd.readouterr().err


def _spread_sleepers(folder: Path) -> None:
    list(parallel_map(partial(_sleeps, folder), range(2), 2))


def test_a_result_is_kept_no_longer_than_whoever_asked_for_it_wants_it() -> None:
    work = parallel_map(np.zeros, range(1, 9), 2)
    kept = [weakref.ref(next(work)[1]) for _ in range(6)]
    assert sum(result() is not None for result in kept) <= 1
    work.close()  # type: ignore[attr-defined]
